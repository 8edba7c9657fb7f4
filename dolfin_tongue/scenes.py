"""Scenes that demos, tests and benchmarks share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dolfin_tongue.body import Body
from dolfin_tongue.boundary import Attached, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Control
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.scene import Scene

#: Viscosity of the tongues, Pa s: the stiffness damping of the published tongue (0.03 s) times its
#: shear modulus (2.07 kPa), rounded. Without it the sag under gravity rings for seconds.
TISSUE_VISCOSITY = 60.0

#: Where the report fixes its tongue (fig. 11).
REPORT_ATTACHMENTS = ("base", "genioglossus_origin", "styloglossus_insertion")


def report_tongue(
    activation: Mapping[str, Control], refinement: int = 1, body: Body | None = None
) -> Scene:
    """Build the report's tongue under gravity (section 5): 42 elements, 8 muscles.

    Parameters
    ----------
    activation : control of each muscle that takes part; may be empty.
    refinement : elements per edge of each of the 42.
    body : a body made before, instead of a new one.
    """
    body = body or preliminary_tongue(refinement)
    terms = [ReportTissue(), Viscosity(TISSUE_VISCOSITY), Gravity()]
    if activation:
        terms.append(ActiveMuscles(activation))
    return Scene(body, tuple(terms), (Attached(*REPORT_ATTACHMENTS),))


def published_scene(
    folder: Path, activation: Mapping[str, Control], body: Body | None = None
) -> Scene:
    """Build the published tongue under gravity: 740 elements, 11 muscles, Yeoh tissue.

    Parameters
    ----------
    folder : with ``tongue.vtu``, ``muscles.json``, ``attachments.json``.
    activation : control of each muscle that takes part; may be empty.
    body : a body read before, instead of reading it again.
    """
    body = body or published_tongue(folder)
    terms = [MooneyRivlin(), Viscosity(TISSUE_VISCOSITY), Gravity()]
    if activation:
        terms.append(ActiveMuscles(activation))
    return Scene(body, tuple(terms), (Attached("jaw", "hyoid"),))
