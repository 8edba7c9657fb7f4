"""How the code is laid out, and its style: no circles, floors, sizes, types, lint."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest

from benchmarks.house import BODY, CHECKOUT, LINES, PARAMETERS, House, circles
from dolfin_tongue.app.demo import Options, load

HOUSE = House()

#: Functions that may have more parameters, and why.
MANY = {
    "dolfin_tongue.app.cli.demo": "options of a command",
    "dolfin_tongue.app.demo.play": "options of `simulate`, and of its pictures",
    "dolfin_tongue.record.run.simulate": "options of a run, keyword-only from the fifth on",
    "dolfin_tongue.view.contact.contact_picture": "options of a picture, keyword-only",
    "dolfin_tongue.view.film.__init__": "options of a picture, keyword-only",
    "dolfin_tongue.view.picture.shape_picture": "options of a picture, keyword-only",
    "dolfin_tongue.view.sheet.contact_sheet": "options of a picture, keyword-only",
}


def test_no_circle_of_rooms_or_files():
    assert circles(HOUSE.rooms) == []
    assert circles(HOUSE.files) == []


def test_arrows_lead_downwards_on_at_most_ten_floors():
    assert 15 <= len(HOUSE.rooms) <= 22
    assert max(HOUSE.floors.values()) <= 10
    for room, below in HOUSE.rooms.items():
        assert all(HOUSE.floors[other] < HOUSE.floors[room] for other in below), room


def test_the_two_solvers_stand_side_by_side():
    assert HOUSE.floors["fenicsx"] == HOUSE.floors["direct"]
    assert "direct" not in HOUSE.rooms["fenicsx"]
    assert "fenicsx" not in HOUSE.rooms["direct"]


def test_modules_functions_and_signatures_fit_on_a_screen():
    long = {name: module.lines for name, module in HOUSE.modules.items() if module.lines > LINES}
    assert not long
    functions = [f for module in HOUSE.modules.values() for f in module.functions()]
    assert not [f for f in functions if f.lines > BODY]
    assert {f.name for f in functions if f.parameters > PARAMETERS} == set(MANY)


def test_the_benchmark_prints_the_house(tmp_path, capsys):
    table = load("house", "benchmark")(Options(tmp_path))
    assert table["circles of rooms"] == table["circles of files"] == 0
    assert "floor  7: direct" in capsys.readouterr().out


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set()}
    assert circles(graph) == [("a", "b", "c")]


@pytest.mark.parametrize(
    "command",
    [
        ["-m", "flake8", "dolfin_tongue", "geometry", "demos", "benchmarks", "tests"],
        ["-m", "isort", "--check-only", "--quiet", "."],
        ["-m", "mypy"],
    ],
    ids=["flake8", "isort", "mypy"],
)
def test_style(command):
    """Lint, order of imports, types; mypy takes 15 s, since it reads all of NumPy's types."""
    pytest.importorskip(command[1])
    done = subprocess.run(
        [sys.executable, *command], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("ruff") is None, reason="ruff is not installed")
@pytest.mark.parametrize("command", [["check"], ["format", "--check"]], ids=["check", "format"])
def test_ruff(command):
    done = subprocess.run(
        ["ruff", *command, "."], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
