"""Compilation of forms: optimised, cached between runs, never shared between unlike processors."""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ufl
from dolfinx import fem

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.errors import TongueError

#: Longest wait for a form that another process compiles, s.
COMPILATION = 300


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
    with _cache() as options:
        return fem.form(form, jit_options=options)


def compile_expression(expression: Any, points: FloatArray) -> fem.Expression:
    """Compile an expression at points of the reference cell, shape (q, 3)."""
    with _cache() as options:
        return fem.Expression(expression, points, jit_options=options)


@contextmanager
def _cache() -> Iterator[dict[str, Any]]:
    """Use the cache together with other processes; drop what a killed compilation left half-done.

    The form compiler takes a source without its ``.cached`` mark for the work of another process
    and waits for it. Only a process that finds the cache unused can know that nobody is at work.
    """
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TongueError(f"no folder for compiled forms: {error}; set XDG_CACHE_HOME") from error
    with (folder / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pass  # in use
        else:
            for source in folder.glob("*.c"):
                if not source.with_name(source.name + ".cached").exists():
                    source.unlink()
        fcntl.flock(lock, fcntl.LOCK_SH)
        yield {
            "cache_dir": str(folder),
            "timeout": COMPILATION,
            "cffi_extra_compile_args": ["-O3", "-march=native", "-fno-math-errno", "-g0"],
        }
