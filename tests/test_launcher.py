"""The launcher `./tongue` and its Dockerfile, as far as they can be checked without making an image.

Engines are played by small scripts that come first in PATH. The launcher gets no variables but those of
the test: neither an engine nor a display of the caller's.
"""

import ast
import itertools
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[1]
LAUNCHER = TOP / "tongue"
DOCKERFILE = TOP / "Dockerfile"

# The Debian package that brings each module, itself or by what it depends on.
PACKAGE_OF = {
    "basix": "python3-dolfinx-real",
    "click": "python3-typer",
    "dolfinx": "python3-dolfinx-real",
    "ffcx": "python3-dolfinx-real",
    "gmsh": "python3-gmsh",
    "h5py": "python3-h5py",
    "hypothesis": "python3-hypothesis",
    "imageio": "python3-imageio",
    "matplotlib": "python3-matplotlib",
    "meshio": "python3-meshio",
    "mpi4py": "python3-dolfinx-real",
    "numba": "python3-numba",
    "numpy": "python3-dolfinx-real",
    "petsc4py": "python3-petsc4py-real",
    "PIL": "python3-pil",
    "pytest": "python3-pytest",
    "pyvista": "python3-pyvista",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "typer": "python3-typer",
    "ufl": "python3-dolfinx-real",
    "vtk": "python3-pyvista",
    "vtkmodules": "python3-pyvista",
}


WORKERS = ["--numprocesses", "auto", "--dist", "worksteal"]


def tongue(*arguments, path=None, cwd=TOP, **variables):
    """Run the launcher, with the folder `path` in front of PATH and no other variables than `variables`."""
    variables["PATH"] = f"{path}:{os.environ['PATH']}" if path else os.environ["PATH"]
    return subprocess.run(
        [LAUNCHER, *arguments],
        cwd=cwd,
        env=variables,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def direct(*arguments, **variables):
    return tongue(*arguments, DOLFIN_TONGUE_ENGINE="direct", **variables)


@pytest.fixture
def play(tmp_path):
    """Return a function that puts scripts into a folder for PATH; no engine, no DOLFINx, no root by default."""

    def play(**scripts):
        nothing = {"docker": "exit 1", "podman": "exit 1", "python3": "exit 1", "id": "echo 1000"}
        folder = tmp_path / "bin"
        folder.mkdir()
        for name, body in (nothing | scripts).items():
            (folder / name).write_text(f"#!/bin/sh\n{body}\n")
            (folder / name).chmod(0o755)
        return folder

    return play


@pytest.mark.parametrize("script", [LAUNCHER, TOP / ".ci" / "run"], ids=["tongue", "ci"])
def test_scripts_are_executable_and_parse(script):
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", script], check=True)


def test_help_lists_the_commands():
    done = tongue("--help")
    assert done.returncode == 0
    for command in ["demo", "test", "bench", "python", "shell", "clean"]:
        assert re.search(rf"^  {command}\b", done.stdout, re.MULTILINE), command


@pytest.mark.parametrize(
    ("arguments", "message"), [(["sing"], "unknown command 'sing'"), ([], "usage:")]
)
def test_unknown_and_missing_command(arguments, message):
    done = tongue(*arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_exit_codes_are_handed_on():
    assert direct("python", "-c", "raise SystemExit(7)").returncode == 7
    assert direct("shell", "-c", "exit 5").returncode == 5
    assert direct("python", "-c", "import os; os.kill(os.getpid(), 15)").returncode == -15


def test_arguments_are_handed_on_as_they_are():
    odd = ["", "two words", "*", "$HOME", "-m"]
    done = direct("python", "-c", "import sys; print(sys.argv[1:])", *odd)
    assert ast.literal_eval(done.stdout) == odd


def test_caches_threads_and_directory(tmp_path):
    code = "import os; print(dict(os.environ, cwd=os.getcwd()))"
    cache = tmp_path / "cache"
    seen = ast.literal_eval(direct("python", "-c", code, DOLFIN_TONGUE_CACHE=str(cache)).stdout)
    for name in ["XDG_CACHE_HOME", "MPLCONFIGDIR", "NUMBA_CACHE_DIR"]:
        assert Path(seen[name]).is_relative_to(cache), name
    assert seen["PYTHONPATH"].split(":")[0] == str(TOP)
    assert seen["OMP_NUM_THREADS"] == "1"

    inside = direct("python", "-c", code, cwd=TOP / "tests", OMP_NUM_THREADS="3")
    seen = ast.literal_eval(inside.stdout)
    assert seen["OMP_NUM_THREADS"] == "3"
    assert seen["cwd"] == str(TOP / "tests")
    assert ast.literal_eval(direct("python", "-c", code, cwd=tmp_path).stdout)["cwd"] == str(
        tmp_path
    )


def test_tests_run_in_the_checkout(play, tmp_path):
    path = play(python3="pwd")
    assert direct("test", path=path, cwd=tmp_path).stdout.strip() == str(TOP)
    assert direct("test", path=path, cwd=TOP / "tests").stdout.strip() == str(TOP / "tests")


def test_data_folder_becomes_a_full_path(tmp_path):
    code = "import os, sys; print([os.environ['DOLFIN_TONGUE_DATA'], *sys.argv[1:]])"
    (tmp_path / "data").mkdir()
    done = direct(
        "python",
        "-c",
        code,
        "--data",
        "data",
        "--data=data",
        cwd=tmp_path,
        DOLFIN_TONGUE_DATA="data",
    )
    data = str(tmp_path / "data")
    assert ast.literal_eval(done.stdout) == [data, "--data", data, f"--data={data}"]


@pytest.mark.parametrize("option", [["--data", "data"], ["--data=data"]])
def test_data_before_a_program_becomes_the_variable(tmp_path, option):
    (tmp_path / "data").mkdir()
    code = "import os, sys; print([os.environ['DOLFIN_TONGUE_DATA'], *sys.argv[1:]])"
    done = direct("python", *option, "-c", code, "x", cwd=tmp_path)
    assert ast.literal_eval(done.stdout) == [str(tmp_path / "data"), "x"]
    done = direct("shell", *option, "-c", "echo $DOLFIN_TONGUE_DATA", cwd=tmp_path)
    assert done.stdout.strip() == str(tmp_path / "data")


def test_results_folder_is_made_where_the_caller_is(play, tmp_path):
    path = play(python3='for argument; do echo "$argument"; done')
    done = direct("demo", "--results", "a/b", "--results=c", path=path, cwd=tmp_path)
    made = [tmp_path / "a" / "b", tmp_path / "c"]
    assert done.stdout.splitlines()[-3:] == ["--results", str(made[0]), f"--results={made[1]}"]
    assert all(folder.is_dir() for folder in made)

    (tmp_path / "file").touch()
    done = direct("demo", "--results", "file/below", path=path, cwd=tmp_path)
    assert done.returncode == 1
    assert "Not a directory" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["-q"], [*WORKERS, "-m", "not slow", "-q"]),
        (["-m", "slow"], [*WORKERS, "-m", "slow"]),
        (["-mslow", "-k", "a or b"], [*WORKERS, "-mslow", "-k", "a or b"]),
        (["-n2"], ["-m", "not slow", "-n2"]),
        (["-s"], ["-m", "not slow", "-s"]),
    ],
)
def test_all_cores_but_slow_tests_only_where_asked_for(play, arguments, expected):
    path = play(python3='for argument; do echo "$argument"; done')
    command = ["-m", "pytest", "-c", f"{TOP}/pyproject.toml", *expected]
    assert direct("test", *arguments, path=path).stdout.splitlines() == command


@pytest.mark.skipif(sys.platform != "linux", reason="Xvfb")
def test_each_run_has_a_display_that_ends_with_it():
    code = "import os; print(os.environ['DISPLAY']); input()"
    variables = {"PATH": os.environ["PATH"], "DOLFIN_TONGUE_ENGINE": "direct"}
    runs = [
        subprocess.Popen(
            [LAUNCHER, "python", "-c", code],
            env=variables,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        for _ in range(3)
    ]
    displays = {run.stdout.readline().strip() for run in runs}
    assert len(displays) == len(runs)
    servers = {run.pid: _children(run.pid) for run in runs}
    for run in runs:
        run.communicate("\n", timeout=30)
        assert run.returncode == 0
    for pid, children in servers.items():
        assert children, f"no display server under {pid}"
        for child in children:
            _wait_until_ended(child)


def _children(pid):
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _wait_until_ended(pid):
    for _ in range(100):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return
        if state == "Z":  # ended, and nobody has asked for its exit code
            return
        time.sleep(0.05)
    pytest.fail(f"process {pid} is still running")


def test_says_why_no_engine_works(play):
    done = tongue("python", path=play())
    assert done.returncode == 1
    assert "python3 has no DOLFINx 0.9" in done.stderr
    assert "no engine answers" in done.stderr
    assert "needs root" in done.stderr


def test_an_engine_asked_for_is_the_only_one_tried(play):
    done = tongue("python", path=play(), DOLFIN_TONGUE_ENGINE="podman")
    assert done.returncode == 1
    assert "podman" in done.stderr
    assert "docker" not in done.stderr
    done = tongue("python", DOLFIN_TONGUE_ENGINE="abacus")
    assert done.returncode == 1
    assert "abacus: unknown" in done.stderr.replace("  ", " ")


ENGINE = """
case "$1 $2" in
    info*) echo "{info}" ;;
    "image inspect") exit {missing} ;;
    build*) echo "STEP 1/2: RUN echo '==> not this'"; echo '#5 0.3 ==> the numerics'; echo '{output}'; exit {code} ;;
    run*) for argument; do echo "$argument"; done ;;
esac
"""


@pytest.mark.parametrize(
    ("info", "user"), [("Server: 1.0", "1000:1000"), ("  rootless: true", "0:0")]
)
def test_what_a_container_gets(play, tmp_path, info, user):
    data, cache = tmp_path / "data", tmp_path / "cache"
    data.mkdir()
    path = play(docker=ENGINE.format(info=info, missing=0, output="", code=0))
    done = tongue(
        "demo",
        "--data",
        str(data),
        path=path,
        DOLFIN_TONGUE_CACHE=str(cache),
        OMP_NUM_THREADS="2",
        CI="1",
    )
    words = done.stdout.splitlines()
    for mount in [f"{TOP}:{TOP}:rw", f"{cache}:{cache}:rw", f"{data}:{data}:ro"]:
        assert words[words.index(mount) - 1] == "--volume"
    assert words[words.index("--user") + 1] == user
    assert {
        "DOLFIN_TONGUE_ENGINE=direct",
        f"DOLFIN_TONGUE_CACHE={cache}",
        "OMP_NUM_THREADS=2",
        "CI=1",
    } <= set(words)
    assert words[-4:] == [str(LAUNCHER), "demo", "--data", str(data)]


def _mounts(done):
    words = done.stdout.splitlines()
    return [after for word, after in itertools.pairwise(words) if word == "--volume"]


def test_what_a_container_gets_of_folders_outside(play, tmp_path):
    here, results = tmp_path / "here", tmp_path / "results"
    here.mkdir()
    path = play(docker=ENGINE.format(info="", missing=0, output="", code=0))
    options = ["--results", "../results", "--results=.", "--data=.", "--data", ".."]
    done = tongue("demo", *options, path=path, cwd=here)
    assert _mounts(done) == [
        f"{TOP}:{TOP}:rw",
        f"{here}:{here}:rw",
        f"{results}:{results}:rw",
        f"{tmp_path}:{tmp_path}:ro",
    ]
    words = done.stdout.splitlines()
    assert words[words.index("-C") + 1] == str(here)
    assert words[-6:-3] == ["--results", str(results), f"--results={here}"]

    for arguments in [["test"], ["demo", "--results", str(TOP / "results")]]:
        done = tongue(*arguments, path=path, cwd=TOP if arguments[0] == "demo" else here)
        assert _mounts(done) == [f"{TOP}:{TOP}:rw"]


@pytest.mark.parametrize("folder", ["/", "/usr", "/etc", "/tmp"])
def test_folders_of_the_system_are_refused(play, tmp_path, folder):
    path = play(docker=ENGINE.format(info="", missing=0, output="", code=0))
    done = tongue("python", path=path, cwd=folder, DOLFIN_TONGUE_CACHE=str(tmp_path))
    assert done.returncode == 1
    assert f"{folder} belongs to the system" in done.stderr
    done = tongue("demo", "--results", folder, path=path, cwd=tmp_path)
    assert done.returncode == 1
    assert tongue("test", path=path, cwd=folder).returncode == 0


def test_a_failing_build_shows_the_end_of_its_log_and_a_hint(play, tmp_path):
    output = "Temporary failure resolving"
    path = play(docker=ENGINE.format(info="", missing=1, output=output, code=3))
    done = tongue("python", path=path, TMPDIR=str(tmp_path), DOLFIN_TONGUE_CACHE=str(tmp_path))
    assert done.returncode == 1
    assert "the numerics" in done.stderr
    assert "not this" not in done.stderr.split("FAILED")[0]
    assert str(tmp_path / "environment.log") in done.stderr
    assert output in done.stderr
    assert "Is there a network" in done.stderr


def test_no_space_is_noticed_before_the_build(play, tmp_path):
    path = play(
        docker=ENGINE.format(info=tmp_path, missing=1, output="", code=0),
        df="echo Filesystem; echo disk 9 9 1048576 9% /",
    )
    done = tongue("python", path=path, TMPDIR=str(tmp_path), DOLFIN_TONGUE_CACHE=str(tmp_path))
    assert done.returncode == 1
    assert "No space" in done.stderr
    assert "only 1 GB are free" in done.stderr


def _imported_modules():
    ours = {"dolfin_tongue", "geometry", "tests", "conftest", "benchmarks", "demos"}
    modules = {}
    for folder in ["dolfin_tongue", "geometry", "tests", "benchmarks", "demos"]:
        for file in (TOP / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                    names = [node.module]
                else:
                    continue
                for name in names:
                    root = name.split(".")[0]
                    beside = (file.parent / f"{root}.py").exists()
                    if root not in sys.stdlib_module_names and root not in ours and not beside:
                        modules.setdefault(root, file.relative_to(TOP))
    return modules


def test_the_dockerfile_installs_what_the_code_imports():
    packages = set(re.findall(r"[a-z0-9][\w.+-]+", DOCKERFILE.read_text()))
    for module, file in _imported_modules().items():
        assert module in PACKAGE_OF, f"{file} imports {module}: which Debian package is that?"
        assert PACKAGE_OF[module] in packages, (
            f"{file} imports {module}: {PACKAGE_OF[module]} is not in the Dockerfile"
        )


def test_no_registry_or_server_is_named():
    host = re.compile(r"\b[a-z0-9-]+(\.[a-z0-9-]+)*\.(io|com|org|net|dev)\b")
    for file in [LAUNCHER, DOCKERFILE]:
        assert not host.search(file.read_text()), file
