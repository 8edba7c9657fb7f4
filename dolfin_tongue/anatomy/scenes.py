"""Scenes that demos, tests and benchmarks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dolfin_tongue.anatomy.bones import hyoid, mandible
from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.errors import BadScene, UnknownName
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import corners_of
from dolfin_tongue.boundary import Attached, Contact, Gravity
from dolfin_tongue.constitutive import ActiveMuscles, MooneyRivlin, ReportTissue, Viscosity
from dolfin_tongue.control import Control, Motion
from dolfin_tongue.geometry.palate import report_palate
from dolfin_tongue.geometry.preliminary import preliminary_tongue
from dolfin_tongue.geometry.published import published_tongue
from dolfin_tongue.scene.scene import Scene
from dolfin_tongue.surfaces import faces_towards, read_surface
from dolfin_tongue.terms.support import Support

#: Viscosity of the tongues, Pa s: the stiffness damping of the published tongue (0.03 s) times its
#: shear modulus (2.07 kPa), rounded. Without it the sag under gravity rings for seconds.
TISSUE_VISCOSITY = 60.0

#: Where the report fixes its tongue (fig. 11).
REPORT_ATTACHMENTS = ("base", "genioglossus_origin", "styloglossus_insertion")

#: What may surround a tongue in the mouth.
SURROUNDINGS = ("palate", "mandible", "hyoid")

#: Distance that the published palate leaves to its tongue at rest, which it overlaps, m.
CLEARANCE = 3e-4

#: Distance within which the published tongue faces its palate at rest, and how far they overlap
#: at most, m.
FACING, OVERLAP = 0.01, 1e-3


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


def report_mouth(
    activation: Mapping[str, Control],
    parts: Sequence[str] = SURROUNDINGS,
    refinement: int = 1,
    *,
    motion: dict[str, Motion] | None = None,
    geniohyoid: Control | None = None,
) -> Scene:
    """Build the report's tongue in a mouth.

    Parameters
    ----------
    activation : control of each muscle that takes part; may be empty.
    parts : some of `SURROUNDINGS`; where mandible or hyoid are left out, the tissue that they
        carry is held.
    refinement : elements per edge of each of the 42.
    motion : prescribed motion of the mandible, see `bones.opening`; default: it is free.
    geniohyoid : activation of the muscle between hyoid and mandible, if both are there.

    Raises
    ------
    UnknownName : a part or muscle that is not there.
    BadScene : a motion without a mandible.
    """
    _check_parts(parts, motion)
    scene = report_tongue(activation, refinement)
    carried = {"mandible": "genioglossus_origin", "hyoid": "base"}
    return _in_mouth(
        scene, parts, carried, ("styloglossus_insertion",), motion, geniohyoid,
        lambda: Contact(report_palate(), "upper"),
    )  # fmt: skip


def published_mouth(
    folder: Path,
    activation: Mapping[str, Control],
    parts: Sequence[str] = SURROUNDINGS,
    *,
    motion: dict[str, Motion] | None = None,
    geniohyoid: Control | None = None,
) -> Scene:
    """Build the published tongue with its palate, mandible and hyoid.

    The palate overlaps the tongue at rest by up to 0.7 mm; it is dented there, so that
    `CLEARANCE` is left (see `Triangulated.with_clearance`).

    Parameters
    ----------
    folder : with ``palate.obj`` besides the files of `published_scene`.
    activation, parts, motion, geniohyoid : as in `report_mouth`.
    """
    _check_parts(parts, motion)
    folder = Path(folder)
    scene = published_scene(folder, activation)
    if "palate" in parts:
        body, palate = scene.body, read_surface(folder / "palate.obj", sheet=True)
        faces = faces_towards(body, palate, FACING, OVERLAP)
        palate = palate.with_clearance(face_samples(body, faces), CLEARANCE)
        body = replace(body, surfaces={**body.surfaces, "palatal": faces})
        scene = replace(scene, body=body)
    carried = {"mandible": "jaw", "hyoid": "hyoid"}
    return _in_mouth(
        scene, parts, carried, (), motion, geniohyoid, lambda: Contact(palate, "palatal")
    )  # fmt: skip


def _check_parts(parts: Sequence[str], motion: dict[str, Motion] | None) -> None:
    """Refuse unknown parts and a motion without a mandible, before meshes are made."""
    if not isinstance(parts, tuple | list):
        raise BadScene(f'parts must be a tuple of names, e.g. ("palate",), not {parts!r}')
    for part in parts:
        if part not in SURROUNDINGS:
            raise UnknownName("part of the mouth", str(part), SURROUNDINGS)
    if motion is not None and "mandible" not in parts:
        raise BadScene('a motion is given, but no mandible; add "mandible" to parts')


def _in_mouth(
    scene: Scene,
    parts: Sequence[str],
    carried: Mapping[str, str],
    held: tuple[str, ...],
    motion: dict[str, Motion] | None,
    geniohyoid: Control | None,
    contact: Callable[[], Contact],
) -> Scene:
    """Replace supports by the bones that are wanted, and add the palate."""
    fixed = [*held, *(region for bone, region in carried.items() if bone not in parts)]
    supports: list[Support] = [Attached(*fixed)] if fixed else []
    if "mandible" in parts:
        supports.append(mandible(carried["mandible"], motion=motion))
    if "hyoid" in parts:
        pull = geniohyoid if "mandible" in parts else None
        supports.append(hyoid(carried["hyoid"], geniohyoid=pull))
    terms = (*scene.terms, contact()) if "palate" in parts else scene.terms
    return Scene(scene.body, terms, tuple(supports))


def face_samples(body: Body, faces: IntArray) -> FloatArray:
    """Nodes and quadrature points of outer faces of a body at rest, shape (k, 3), m."""
    faces = corners_of(faces)
    corners = body.points[faces]
    a, b = (1 + 3**-0.5) / 2, (1 - 3**-0.5) / 2
    weights = np.array([a * a, a * b, b * b, a * b])
    inner = [np.einsum("k,fkc->fc", np.roll(weights, i), corners) for i in range(4)]
    return np.concatenate([body.points[np.unique(faces)], *inner])
