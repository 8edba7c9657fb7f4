"""Every demo runs as the command line runs it, and says something true."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from dolfin_tongue.app.demo import CHECKOUT, Options, available, load

#: Step of each demo here, s (larger than its own), and files that its pictures make.
STEPS = {
    "drop": 1e-2,
    "jaw": 1e-2,
    "laws": None,
    "mouth": 1e-2,
    "muscles": 1e-2,
    "palate": 1e-2,
    "published": 2e-2,
    "tongue": 1e-2,
}
PICTURED = ("jaw", "laws", "muscles")


def test_every_demo_is_run_here():
    assert set(available()) == set(STEPS)
    assert all(len(text) > 20 for text in available().values())


@pytest.mark.parametrize("name", [name for name in STEPS if name != "published"])
def test_a_demo(name, tmp_path):
    """By the direct solver, which is fast; with the pictures of some."""
    folder = tmp_path / name
    options = Options(folder, dt=STEPS[name], pictures=name in PICTURED, solver="direct")
    rows = load(name)(options)
    assert rows
    numbers = [
        x for row in rows.values() for x in (row.values() if isinstance(row, dict) else [row])
    ]
    assert all(np.isfinite(x) for x in numbers if isinstance(x, float))
    for path in folder.rglob("summary.json"):
        summary = json.loads(path.read_text(encoding="utf-8"))
        assert summary["status"] == "finished"
        assert summary["max_volume_change"] < 1e-8
    if name in PICTURED:
        pictures = list(folder.rglob("*.png"))
        assert pictures and all(path.stat().st_size > 5000 for path in pictures)


def test_the_published_demo(published_folder, tmp_path):
    options = Options(
        tmp_path, data=published_folder, dt=STEPS["published"], pictures=False, solver="direct"
    )
    rows = load("published")(options)
    assert rows["largest relative volume change of a cell"] < 1e-8
    assert any("tip" in name for name in rows)


def test_a_demo_by_fenicsx(tmp_path):
    pytest.importorskip("dolfinx")
    rows = load("tongue")(Options(tmp_path, dt=2e-2, pictures=False))
    direct = load("tongue")(Options(tmp_path / "d", dt=2e-2, pictures=False, solver="direct"))
    assert rows["tip moved, mm"].split()[0] == "back"
    mine, theirs = (float(x["tip moved, mm"].split()[1].rstrip(",")) for x in (direct, rows))
    assert mine == pytest.approx(theirs, abs=0.2)


def test_the_example_of_the_readme(tmp_path, monkeypatch, capsys):
    """As it is printed: one import line, a run, and what it left read back."""
    pytest.importorskip("dolfinx")
    text = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec", dont_inherit=True), {"__name__": "readme"})
    first, second = capsys.readouterr().out.strip().splitlines()[-2:]
    assert float(first.split()[-1]) < 1e-8  # largest volume change
    assert second.startswith("(96, 3, 3)") and float(second.split()[-1]) > 1.0  # N
