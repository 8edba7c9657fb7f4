"""Compilation of forms: optimised, cached between runs, never shared between unlike processors."""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ufl
from dolfinx import fem

from dolfin_tongue.errors import TongueError


def cache_folder() -> Path:
    """Folder of the compiled forms of this processor type.

    Kernels are compiled for the processor at hand (`-march=native`); a cache that moves to another
    machine must not be loaded there, so its flags are part of the path.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    flags = platform.machine() + platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = cpuinfo.read_text().splitlines()
        flags += "".join(sorted({x for x in lines if x.startswith(("flags", "model name"))}))
    key = hashlib.sha256(flags.encode()).hexdigest()[:12]
    return base / "dolfin_tongue" / "forms" / key


def compile_form(form: ufl.Form) -> fem.Form:
    """Compile a form with optimised C; loads it from the cache where it was compiled before."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TongueError(f"no folder for compiled forms: {error}; set XDG_CACHE_HOME") from error
    options = {
        "cache_dir": str(folder),
        "cffi_extra_compile_args": ["-O3", "-march=native", "-fno-math-errno", "-g0"],
    }
    with _alone(folder):
        return fem.form(form, jit_options=options)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the cache for this process, and drop what a killed compilation left half-done.

    The form compiler takes a source without its ``.cached`` mark for the work of another process
    and waits for it until it gives up.
    """
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for source in folder.glob("*.c"):
            if not source.with_name(source.name + ".cached").exists():
                source.unlink()
        yield
