"""What a muscle does at one instant: activation, stretch, stress, force; in plain NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dolfin_tongue.base.arrays import FloatArray, IntArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.fibre_lines import fibre_lengths
from dolfin_tongue.body.point_set import PointSet
from dolfin_tongue.body.regions import CellValues
from dolfin_tongue.constitutive.fibre_stress import FibreStress, component
from dolfin_tongue.control import Instant
from dolfin_tongue.march.observed import MuscleState


class MuscleStates:
    """The muscles of all fibre stresses of a scene.

    Parameters
    ----------
    body : the body.
    points : its quadrature points.
    terms : terms with their labels, fibre stresses among them.
    """

    def __init__(self, body: Body, points: PointSet, terms: Sequence[tuple[str, Any]]):
        self._parts = [
            (label, _TermStates(body, points, term))
            for label, term in terms
            if isinstance(term, FibreStress)
        ]

    @property
    def any(self) -> bool:
        """Whether there is a muscle."""
        return bool(self._parts)

    def __call__(self, F: FloatArray, rate: FloatArray, now: Instant) -> dict[str, MuscleState]:
        """States by name of the muscle.

        Parameters
        ----------
        F, rate : ndarray, shape (Q, 3, 3) -- deformation gradient and its rate, 1/s.
        now : time and memory.
        """
        found: dict[str, MuscleState] = {}
        for label, part in self._parts:
            found |= part(F, rate, now.of(label))
        return found


class _TermStates:
    """The muscles of one term; what does not change with time is prepared."""

    def __init__(self, body: Body, points: PointSet, term: FibreStress):
        self._term, self._points, self._slots = term, points, term.slots(body)
        self._strength = self._at_points(term.strength(self._slots, body))
        self._factors = term.factors(self._at_points, self._slots, body)
        self._lengths = {name: fibre_lengths(body, name) for name in term.names}
        self._cells = {name: body.fibres[name].cells for name in term.names}
        #: Points of each muscle, their slot, and volume over fibre length, m2.
        self._places = {name: self._place(number) for number, name in enumerate(term.names)}

    def _at_points(self, values: CellValues) -> FloatArray:
        """Values at the quadrature points, shape () or (Q, s)."""
        array = values.array
        if not array.ndim:
            return array
        if array.shape[1] == 1:
            return array[self._points.cells, 0]
        return array.reshape(len(self._points.cells), -1)

    def _place(self, number: int) -> tuple[IntArray, IntArray, FloatArray]:
        slots, name = self._slots, self._term.names[number]
        own = (slots.muscle == number) & (slots.density > 0)
        length = np.full(len(own), np.nan)
        length[self._cells[name]] = self._lengths[name]
        at = np.flatnonzero(own.any(axis=1)[self._points.cells])
        cells = self._points.cells[at]
        return at, own.argmax(axis=1)[cells], self._points.weights[at] / length[cells]

    def __call__(self, F: FloatArray, rate: FloatArray, now: Instant) -> dict[str, MuscleState]:
        activation = self._term.activations(now)
        levels = self._slots.level(activation)[self._points.cells]
        ratio = np.linalg.det(F)
        directions = self._slots.directions[self._points.cells]
        by_slot = []
        for slot in range(self._slots.count):
            N = directions[:, slot]
            n, w = np.einsum("pij,pj->pi", F, N), np.einsum("pij,pj->pi", rate, N)
            stretch = np.linalg.norm(n, axis=1)
            with np.errstate(invalid="ignore", divide="ignore"):  # slots without fibres
                speed = (n * w).sum(axis=1) / stretch
                stress = component(self._strength, slot) * levels[:, slot]
                stress = stress * self._factors(slot, stretch, speed, ratio)
                by_slot.append((stretch, speed, stress, ratio * stress / stretch))
        found = {}
        for number, (name, (at, own, section)) in enumerate(self._places.items()):
            stretch, speed, stress, tension = (
                np.stack([part[i] for part in by_slot], axis=1)[at, own] for i in range(4)
            )
            level = float(activation[number])
            force = float(tension @ section)
            found[name] = MuscleState(level, at, stretch, speed, stress, tension, force)
        return found
