"""The eight muscles of the preliminary tongue, defined in its unit block (report, figs. 19-26).

Directions are constant in a parent element and given in steps of parent elements along r (to the
tip), s (to the left) and t (up); the Jacobian of the Bezier solid carries them to the tongue.

Fibre density. The active stress of a muscle is S_max times its fibre density (report, section 5.3,
item 1). With the published physiological cross-section A of a muscle (both sides together) and
the cross-section V / L that it has in this mesh (V: volume of its elements, L: mean length of a
fibre through them), the density A / (V / L) makes its largest force S_max A. Where parents hold
unequal shares of the fibres, V is weighted by the share and the density multiplied by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.base.units import mm
from dolfin_tongue.body.block import blocks_of
from dolfin_tongue.body.fibres import Fibres, MuscleFibres
from dolfin_tongue.geometry.bezier import BezierSolid
from dolfin_tongue.geometry.block import DIVISIONS, UnitBlock

Parent = tuple[int, int, int]


class Part(NamedTuple):
    """Parents of a muscle that share a direction.

    Parameters
    ----------
    along, across, up : the parents' indices i, j and k; all combinations.
    direction : steps of parents along r, s and t; of any length.
    share : fibres relative to the densest part of the muscle.
    """

    along: tuple[int, ...]
    across: tuple[int, ...]
    up: tuple[int, ...]
    direction: tuple[float, float, float]
    share: float = 1.0


SIDES, CENTRE, ALL = (0, 2), (1,), (0, 1, 2)
LOW, HIGH, BOTH = (0,), (1,), (0, 1)

#: Parts of every muscle. The genioglossus fans out from its origin at i = 3 to 4 on the
#: underside, the hyoglossus rises from the base, the styloglossus runs from its insertion forward
#: and down into the sides; the others follow the axes of the block.
MUSCLES: Mapping[str, tuple[Part, ...]] = {
    "genioglossus_anterior": (
        Part((3,), CENTRE, BOTH, (-0.1, 0, 1)),
        Part((4,), CENTRE, LOW, (0.85, 0, 1)),
        Part((5,), CENTRE, LOW, (0.85, 0, 1), 0.5),
        Part((4, 5), CENTRE, HIGH, (0.3, 0, 1)),
    ),
    "genioglossus_posterior": (
        Part((0, 1), CENTRE, LOW, (-1, 0, 0.25)),
        Part((2,), CENTRE, LOW, (-1, 0, 0.6)),
        Part((0, 1), CENTRE, HIGH, (-0.8, 0, 1)),
        Part((2,), CENTRE, HIGH, (-0.5, 0, 1)),
    ),
    "styloglossus": (
        Part((1, 2, 3), SIDES, HIGH, (1, 0, -0.2)),
        Part((4, 5), SIDES, HIGH, (1, 0, -0.1)),
        Part((4, 5), SIDES, LOW, (1, 0, 0), 0.5),
    ),
    "hyoglossus": (
        Part((0, 1, 2, 3), SIDES, LOW, (1, 0, 0.15)),
        Part((1, 2, 3), SIDES, HIGH, (1, 0, 0.45)),
    ),
    "longitudinalis_inferior": (
        Part((2, 3, 4, 5, 6), SIDES, LOW, (1, 0, 0)),
        Part((5, 6), CENTRE, LOW, (1, 0, 0), 0.3),
    ),
    "longitudinalis_superior": (Part((0, 1, 2, 3, 4, 5, 6), ALL, HIGH, (1, 0, 0)),),
    "transversalis": (
        Part((1, 2, 3, 4, 5, 6), ALL, HIGH, (0, 1, 0)),
        Part((4, 5, 6), ALL, LOW, (0, 1, 0), 0.5),
    ),
    "verticalis": (
        Part((3, 4, 5, 6), SIDES, LOW, (0, 0, 1)),
        Part((4, 5, 6), SIDES, HIGH, (0, 0, 1)),
        Part((4, 5, 6), CENTRE, BOTH, (0, 0, 1), 0.3),
    ),
}

#: Physiological cross-sections of the tongue muscles, both sides together, mm2: S. Buchaillard,
#: P. Perrier, Y. Payan, "A biomechanical model of cardinal vowel production", J. Acoust. Soc. Am.
#: 126 (2009) 2033-2051; their largest forces are these areas times 22 N/cm2. The medium part of
#: the genioglossus (54.5) counts as anterior here.
CROSS_SECTIONS: Mapping[str, float] = {
    "genioglossus_anterior": 82.0 + 54.5,
    "genioglossus_posterior": 168.0,
    "styloglossus": 109.0,
    "hyoglossus": 295.0,
    "longitudinalis_inferior": 41.0,
    "longitudinalis_superior": 86.0,
    "transversalis": 227.0,
    "verticalis": 91.0,
}


def block_fibres(block: UnitBlock, solid: BezierSolid) -> Fibres:
    """Fibres of the eight muscles in a refinement of the block that `solid` maps to a tongue.

    Parameters
    ----------
    block : the block or a refinement; a cell has the direction of its parent, carried to the
        tongue at the cell's own centre, and the fibre density of its parent.
    solid : the map.
    """
    volumes = _parent_volumes(block, solid)
    return Fibres(
        tuple(_muscle(name, parts, block, solid, volumes) for name, parts in MUSCLES.items())
    )


def _muscle(
    name: str,
    parts: tuple[Part, ...],
    block: UnitBlock,
    solid: BezierSolid,
    volumes: Mapping[Parent, float],
) -> MuscleFibres:
    """Fibres of one muscle in the cells of a block."""
    steps, shares = _spread(parts)
    scale = CROSS_SECTIONS[name] * mm**2 / mesh_cross_section(steps, shares, solid, volumes)
    parents: list[Parent] = [(int(i), int(j), int(k)) for i, j, k in block.parents]
    cells: IntArray = np.array([c for c, parent in enumerate(parents) if parent in steps])
    in_block = np.array([steps[parents[c]] / DIVISIONS for c in cells])
    density = scale * np.array([shares[parents[c]] for c in cells])
    return MuscleFibres(name, cells, solid.push_forward(block.centres[cells], in_block), density)


def _spread(parts: tuple[Part, ...]) -> tuple[dict[Parent, FloatArray], dict[Parent, float]]:
    """Direction (in steps of parents) and share of every parent of a muscle."""
    steps: dict[Parent, FloatArray] = {}
    shares: dict[Parent, float] = {}
    for part in parts:
        for parent in product(part.along, part.across, part.up):
            steps[parent] = np.array(part.direction, dtype=float)
            shares[parent] = part.share
    return steps, shares


def _parent_volumes(block: UnitBlock, solid: BezierSolid) -> dict[Parent, float]:
    """Volume of every parent as its cells fill it, m3; so a force is the same in any refinement."""
    (mapped,) = blocks_of(solid.map(block.rst), {"hexahedron8": block.cells})
    total: dict[Parent, float] = {}
    for number, volume in enumerate(mapped.weights.sum(axis=1)):
        i, j, k = block.parents[number]
        parent = (int(i), int(j), int(k))
        total[parent] = total.get(parent, 0.0) + float(volume)
    return total


def mesh_cross_section(
    steps: Mapping[Parent, FloatArray],
    shares: Mapping[Parent, float],
    solid: BezierSolid,
    volumes: Mapping[Parent, float],
) -> float:
    """Cross-section that a muscle has in the mesh: sum of share times volume, over fibre length.

    The fibre length is the mean over the parents, weighted by share times volume, of the length of
    the fibre through the parent's centre within the muscle.

    Parameters
    ----------
    steps : direction of every parent of the muscle, shape (3,), in steps of parents.
    shares : relative number of fibres in every parent.
    solid : the map of the block.
    volumes : volume of every parent, m3.

    Returns
    -------
    float, m2.
    """
    weight = np.array([shares[parent] * volumes[parent] for parent in steps])
    length = np.array([fibre_length(parent, steps, solid) for parent in steps])
    return float(weight.sum() ** 2 / (weight * length).sum())


def fibre_length(start: Parent, steps: Mapping[Parent, FloatArray], solid: BezierSolid) -> float:
    """Length of the fibre through the centre of a parent, within its muscle.

    In the block a fibre is a straight line in every parent; it is followed both ways until it
    leaves the muscle.

    Parameters
    ----------
    start : the parent.
    steps : direction of every parent of the muscle, shape (3,), in steps of parents.
    solid : the map of the block.

    Returns
    -------
    float, m.
    """
    length = 0.0
    for sense in (1.0, -1.0):
        place, parent, heading = np.add(start, 0.5), start, sense * steps[start]
        for _ in range(2 * sum(DIVISIONS)):  # more parents than any fibre can cross
            heading = steps[parent] * (1.0 if steps[parent] @ heading >= 0 else -1.0)
            leave, axis = _exit(place, parent, heading)
            path = np.linspace(place, leave, 5) / DIVISIONS
            length += float(np.linalg.norm(np.diff(solid.map(path), axis=0), axis=1).sum())
            ahead = list(parent)
            ahead[axis] += 1 if heading[axis] > 0 else -1
            place, parent = leave, (ahead[0], ahead[1], ahead[2])
            if parent not in steps:
                break
    return length


def _exit(place: FloatArray, parent: Parent, heading: FloatArray) -> tuple[FloatArray, int]:
    """Where a straight line leaves a parent, in units of parents, and across which axis."""
    wall = np.asarray(parent) + (heading > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(heading == 0, np.inf, (wall - place) / heading)
    axis = int(distance.argmin())
    return place + max(distance[axis], 0.0) * heading, axis
