"""Kinematics of a rigid body with two translations and one rotation in the plane y = constant.

Coordinates q = (x, z, angle): displacement of the reference point, m, and rotation about the y axis
by the right-hand rule, rad. With x from front to back and z up, a positive angle lifts what lies in
front of the reference point: a mandible opens with negative angles. An arm a = X - X_ref turns to
r = R a, with r_x = a_x cos + a_z sin, r_z = a_z cos - a_x sin; dr/d(angle) = (r_z, 0, -r_x) and
d2r/d(angle)2 = (-r_x, 0, -r_z).
"""

from __future__ import annotations

import numpy as np

from dolfin_tongue.base.arrays import FloatArray


def turned(arms: FloatArray, angle: float | FloatArray) -> FloatArray:
    """Arms (k, 3), m, after a rotation; one angle, or one for each arm."""
    c, s = np.cos(angle), np.sin(angle)
    result = np.empty_like(arms)
    result[:, 0] = c * arms[:, 0] + s * arms[:, 2]
    result[:, 1] = arms[:, 1]
    result[:, 2] = c * arms[:, 2] - s * arms[:, 0]
    return result


def displacement(arms: FloatArray, q: FloatArray) -> FloatArray:
    """Displacement of body-fixed points, shape (k, 3), m; q of shape (3,), or (k, 3)."""
    moved = turned(arms, q[..., 2]) - arms
    moved[:, 0] += q[..., 0]
    moved[:, 2] += q[..., 1]
    return moved


def jacobian(arms: FloatArray, q: FloatArray) -> FloatArray:
    """T = d(displacement)/dq, shape (k, 3, 3): component, then coordinate; q as above."""
    r = turned(arms, q[..., 2])
    T = np.zeros((len(arms), 3, 3))
    T[:, 0, 0] = T[:, 2, 1] = 1.0
    T[:, 0, 2], T[:, 2, 2] = r[:, 2], -r[:, 0]
    return T


def bend(arms: FloatArray, q: FloatArray) -> FloatArray:
    """d2(displacement)/d(angle)2, the only second derivative, shape (k, 3), m; q as above."""
    r = turned(arms, q[..., 2])
    return -r * [1.0, 0.0, 1.0]
