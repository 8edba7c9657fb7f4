"""The X display that VTK draws through, even into files."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from functools import cache

from dolfin_tongue.base.errors import TongueError

_HINT = "Run it by ./tongue, which starts a virtual display, or by xvfb-run"


class NoDisplay(TongueError, RuntimeError):
    """There is no X display, and none could be started."""


def _connect() -> int | None:
    """Open a connection to the display of DISPLAY; None if that fails."""
    try:
        library = ctypes.CDLL("libX11.so.6")
    except OSError:
        return None
    library.XOpenDisplay.restype = ctypes.c_void_p
    return library.XOpenDisplay(None)


def _start_server() -> str:
    """Start Xvfb on a free display, which it chooses by itself; return its number."""
    if shutil.which("Xvfb") is None:
        raise NoDisplay(f"three-dimensional pictures need an X display, or Xvfb. {_HINT}")
    read, write = os.pipe()
    # -terminate: the server ends with its last client. That is this process, however it ends,
    # since `ensure_display` keeps a connection open.
    command = ["Xvfb", "-displayfd", str(write), "-terminate", "-nolisten", "tcp"]
    subprocess.Popen(
        [*command, "-screen", "0", "1600x1200x24"],
        pass_fds=[write],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # not hit by a Ctrl-C that is meant for this process
    )
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    if not number:
        raise NoDisplay(f"Xvfb ended without a display. {_HINT}")
    return number


@cache
def ensure_display() -> None:
    """Make sure that there is a display, once per process: VTK ends the process without one.

    Raises
    ------
    NoDisplay : DISPLAY names none that answers, or it is not set and Xvfb cannot be started.
    """
    given = os.environ.get("DISPLAY")
    if not given:
        os.environ["DISPLAY"] = f":{_start_server()}"
    if _connect() is None:
        if not given:
            del os.environ["DISPLAY"]
        raise NoDisplay(f"the X display {given or 'of Xvfb'!r} does not answer. {_HINT}")
