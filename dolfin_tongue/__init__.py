"""A 3D, dynamic, incompressible, muscle-activated tongue under large deformation.

The names that most scripts need are here; each is loaded when it is asked for, so that the direct
solver runs where FEniCSx is not installed. All others are in the rooms: `constitutive`, `boundary`,
`rigid`, `control`, `surfaces`, ...; the map of the rooms is in README.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

#: Name -> the room that has it.
_ROOMS = {
    "ActiveMuscles": "constitutive",
    "Attached": "boundary",
    "Body": "body",
    "Contact": "boundary",
    "GeneralisedAlpha": "fenicsx",
    "Gravity": "boundary",
    "Parameter": "base.values",
    "Ramp": "control",
    "ReportTissue": "constitutive",
    "Scene": "scene",
    "SmoothRamp": "control",
    "Statics": "fenicsx",
    "TrBdf2": "direct",
    "Viscosity": "constitutive",
    "load_run": "record",
    "preliminary_tongue": "geometry.preliminary",
    "simulate": "record",
}

__all__ = ["__version__", *_ROOMS]


def __getattr__(name: str) -> Any:
    """Load one of the names."""
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ROOMS[name]}"), name)


def __dir__() -> list[str]:
    """List the names."""
    return sorted([*globals(), *_ROOMS])
