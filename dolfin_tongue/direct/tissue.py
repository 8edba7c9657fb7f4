"""Stress in the tissue: laws at quadrature points, summed before the nodes are asked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.body import Body
from dolfin_tongue.control import Instant
from dolfin_tongue.direct import points
from dolfin_tongue.direct.parts import Configuration, Part, Tangent

#: No fibres, and no level: shapes (1, 1, 3) and (1, 0).
NO_FIBRES, NO_LEVEL = np.zeros((1, 1, 3)), np.zeros((1, 0))


@dataclass(frozen=True, eq=False)
class PointLaw:
    """The law of one term in one block of cells, as compiled loops over its points.

    Parameters
    ----------
    stress : (F, rate, numbers, fibres, level, out): adds P, Pa, to out, shape (m, q, 3, 3).
    moduli : (F, rate, numbers, fibres, level, (f, r), out): adds f dP/dF + r dP/d(rate) to out,
        shape (m, q, 9, 9).
    numbers : ndarray, shape (m or 1, q or 1, k) -- of the law.
    energy : (F, numbers, fibres) -> energy per reference volume, shape (m, q), J/m3; None for a law
        without one.
    rate_dependent : whether the stress depends on the rate of F.
    fibres : ndarray, shape (m, s, 3) -- unit vectors.
    level : of the fibre slots at an instant, shape (m, s): density times activation.
    """

    stress: Callable[..., None]
    moduli: Callable[..., None]
    numbers: FloatArray
    energy: Callable[..., FloatArray] | None = None
    rate_dependent: bool = False
    fibres: FloatArray = field(default_factory=lambda: NO_FIBRES)
    level: Callable[[Instant], FloatArray] = lambda now: NO_LEVEL


class Level:
    """Activations of fibre slots, evaluated once per instant.

    Parameters
    ----------
    at : of an instant, shape (m, s).
    """

    def __init__(self, at: Callable[[Instant], FloatArray]):
        self._at, self._now = at, Instant(np.nan)
        self._level: FloatArray = NO_LEVEL

    def __call__(self, now: Instant) -> FloatArray:
        """Density times activation, shape (m, s)."""
        if now.time != self._now.time or now.memory is not self._now.memory:
            self._now, self._level = now, np.ascontiguousarray(self._at(now))
        return self._level


class Tissue(Part):
    """All stress laws of a scene.

    Parameters
    ----------
    body : the tissue.
    laws : label of each term and its laws, one per block.
    """

    def __init__(self, body: Body, laws: Sequence[tuple[str, Sequence[PointLaw]]]):
        self.body, self.laws = body, list(laws)
        self.labels = tuple(label for label, _ in laws)
        self.rate_dependent = any(parts[0].rate_dependent for _, parts in laws)

    def add_force(self, at: Configuration, out: FloatArray) -> None:
        """Add -int P : grad N (39)."""
        for number, block in enumerate(self.body.blocks):
            F, rate = at.strains[number]
            stress = np.zeros_like(F)
            for label, parts in self.laws:
                law, level = parts[number], parts[number].level(at.now.of(label))
                law.stress(F, rate, law.numbers, law.fibres, level, stress)
            points.add_nodal_forces(stress, block.cells, block.gradients, block.weights, out)

    def add_tangent(self, at: Configuration, tangent: Tangent) -> None:
        """Add int grad N : (factor dP/dF + rate_factor dP/d(rate)) : grad N."""
        for number, block in enumerate(self.body.blocks):
            F, rate = at.strains[number]
            factors = (tangent.factor, tangent.rate_factor)
            moduli = np.zeros((*block.shape, 9, 9))
            for label, parts in self.laws:
                if tangent.counts(label):
                    law = parts[number]
                    given = (law.numbers, law.fibres, law.level(at.now.of(label)))
                    law.moduli(F, rate, *given, factors, moduli)
            out = tangent.matrices[number]
            points.add_element_matrices(moduli, block.gradients, block.weights, out)

    def stresses(self, at: Configuration) -> dict[str, FloatArray]:
        """First Piola-Kirchhoff stress of each term at all points, shape (Q, 3, 3), Pa."""
        found = {}
        for label, parts in self.laws:
            total = []
            for (F, rate), law in zip(at.strains, parts, strict=True):
                stress = np.zeros_like(F)
                level = law.level(at.now.of(label))
                law.stress(F, rate, law.numbers, law.fibres, level, stress)
                total.append(stress.reshape(-1, 3, 3))
            found[label] = np.concatenate(total)
        return found

    def energies(self, at: Configuration) -> dict[str, float]:
        """Energies of the laws that have one, J."""
        found = {}
        for label, parts in self.laws:
            total = 0.0
            for block, (F, _), law in zip(self.body.blocks, at.strains, parts, strict=True):
                if law.energy is not None:
                    density = law.energy(F, law.numbers, law.fibres)
                    total += float(np.sum(block.weights * density))
            if parts[0].energy is not None:
                found[label] = total
        return found

    def powers(self, at: Configuration) -> dict[str, float]:
        """Minus the stress power P : dF/dt of the laws that have no energy, W."""
        found = {}
        stresses = self.stresses(at)
        for label, parts in self.laws:
            if parts[0].energy is None:
                weights = np.concatenate([block.weights.ravel() for block in self.body.blocks])
                rates = np.concatenate([rate.reshape(-1, 3, 3) for _, rate in at.strains])
                power = (stresses[label] * rates).sum(axis=(1, 2))
                found[label] = -float(weights @ power)
        return found
