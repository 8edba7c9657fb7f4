"""Momentum and energy of a motion: what a free, undamped body must keep."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.body.state import State
from dolfin_tongue.direct.model import Model


@dataclass(frozen=True)
class Drift:
    """Largest change since the first state of a motion, relative.

    Parameters
    ----------
    momentum : over the largest sum_K m_K |v_K| of the states.
    angular_momentum : likewise, with the distance to the centre of mass as lever.
    energy : kinetic, stored and potential energy, over the largest kinetic energy.
    """

    momentum: float
    angular_momentum: float
    energy: float


def momentum(model: Model, state: State) -> tuple[FloatArray, FloatArray]:
    """Momentum, N s, and angular momentum about the origin, N m s; each of shape (3,).

    Of the tissue and the rigid bodies.
    """
    nodal = model.mass @ state.velocity
    position = model.body.points + state.displacement
    linear, angular = nodal.sum(axis=0), np.cross(position, nodal).sum(axis=0)
    own = model.bodies.momentum(state.rigid, state.rigid_rate)
    return linear + own[0], angular + own[1]


def drift(model: Model, states: Iterable[State]) -> Drift:
    """How far momentum, angular momentum and energy leave their first values."""
    states = list(states)
    nodal = np.array([np.linalg.norm(model.mass @ s.velocity, axis=1) for s in states])
    mass = np.asarray(model.mass.sum(axis=1)).ravel()
    lever = np.linalg.norm(model.body.points - mass @ model.body.points / mass.sum(), axis=1)
    kinetic = max(0.5 * float(np.sum(s.velocity * (model.mass @ s.velocity))) for s in states)
    pairs = [momentum(model, s) for s in states]
    linear, angular = (np.array(part) for part in zip(*pairs, strict=True))
    energy = np.array([model.energy(state) for state in states])
    return Drift(
        float(np.linalg.norm(linear - linear[0], axis=1).max() / nodal.sum(axis=1).max()),
        float(np.linalg.norm(angular - angular[0], axis=1).max() / (nodal @ lever).max()),
        float(np.abs(energy - energy[0]).max() / kinetic),
    )
