"""What a run is: scene and method, versions, date, command, in ``scene.json`` and ``scene.npz``."""

from __future__ import annotations

import json
import platform
import sys
import zipfile
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from dolfin_tongue.base.errors import BadScene
from dolfin_tongue.base.files import replacing, write_json
from dolfin_tongue.record.codec import Decoder, Encoder
from dolfin_tongue.scene.scene import Scene

#: Packages whose versions a result may depend on.
PACKAGES = (
    "dolfin-tongue", "numpy", "scipy", "numba", "fenics-dolfinx", "fenics-ufl", "fenics-basix",
    "petsc4py", "gmsh",
)  # fmt: skip


def versions() -> dict[str, str]:
    """Versions of Python, of this package and of those that it stands on, where installed."""
    from dolfin_tongue import __version__

    found = {"python": platform.python_version(), "dolfin-tongue": __version__}
    for package in PACKAGES:
        try:
            found.setdefault(package, version(package))
        except PackageNotFoundError:
            continue
    return found


def write_description(folder: Path, scene: Scene, method: Any, frame_interval: float) -> None:
    """Write what is simulated, how, and by what."""
    encoder = Encoder()
    content = {
        "sessions": [session(0.0)],
        "frame_interval_s": frame_interval,
        "method": encoder.encode(method),
        "scene": encoder.encode(scene),
    }
    with replacing(folder / "scene.npz") as path:
        arrays: dict[str, Any] = encoder.arrays
        np.savez(path, **arrays)
    write_json(folder / "scene.json", content)


def session(start: float) -> dict[str, Any]:
    """When, by which command and versions a run, or a part of one from a time (s), was made."""
    date = datetime.now(UTC).astimezone().isoformat(timespec="seconds")
    return {"from_s": start, "date": date, "command": sys.argv, "versions": versions()}


def add_session(folder: Path, start: float) -> None:
    """Note that a run is continued."""
    path = folder / "scene.json"
    if path.exists():
        content = json.loads(path.read_text(encoding="utf-8"))
        content["sessions"].append(session(start))
        write_json(path, content)


def read_description(
    folder: Path, own: Iterable[Any] = (), scene: Scene | None = None
) -> tuple[Scene, Any]:
    """Read scene and method of a run back.

    Parameters
    ----------
    folder : of the run.
    own : classes and functions of the caller's that the scene is made of.
    scene : taken instead of the one in the file.

    Raises
    ------
    BadScene : no description, a damaged one, or one that names unknown classes.
    """
    path = folder / "scene.json"
    if not path.exists():
        raise BadScene(f"{folder} holds no run: there is no {path.name}")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        with np.load(folder / "scene.npz") as file:
            arrays = {name: file[name] for name in file.files}
        decoder = Decoder(arrays, own)
        method = decoder.decode(content["method"])
        scene = decoder.decode(content["scene"]) if scene is None else scene
    except BadScene:
        raise
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise BadScene(f"{path} cannot be read: {error}") from error
    if not isinstance(scene, Scene):
        raise BadScene(f"{path} holds no scene but {scene!r}")
    return scene, method
