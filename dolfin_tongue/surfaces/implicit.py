"""Ellipsoid, and any surface g = 0: their signed distance by the nearest point.

Let p be the point of the surface nearest to y, n the unit normal there and d the distance, so that
y = p + d n(p). Moving y by e moves p in the tangent plane, and n by S times that, where S is the
shape operator, S = P (dd g) P / |d g| with the projector P on the tangent plane; hence e = dp +
d S dp + n (n.e). So d has the gradient n(p) and the Hessian S (I + d S)^-1: principal curvatures
k become k / (1 + d k), as on a sphere 1/R becomes 1/(R + d).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfin_tongue.base.arrays import BoolArray, FloatArray
from dolfin_tongue.base.errors import (
    OutOfRange,
    TongueError,
    require_flags,
    require_positive,
    require_vector,
)
from dolfin_tongue.surfaces.base import Gap, Surface
from dolfin_tongue.surfaces.differences import Function, first_derivatives, second_derivatives
from dolfin_tongue.surfaces.simple import Vector

if TYPE_CHECKING:  # UFL's algorithms are loaded when they are needed
    from dolfin_tongue.surfaces.formula import Formula

#: Least 1 + d k: nearer to a centre of curvature the nearest point is not unique.
FOCUS = 1e-3

#: Most steps to a nearest point, and the length of a step that ends them, over the distance.
STEPS, CLOSE = 60, 1e-13

#: What a function may be.
KINDS = "a NumPy function of points (k, 3) with values (k,), or a UFL scalar of a UFL vector"

#: Places where a function of a place is tried, m.
PROBES = np.array(
    [[0.011, -0.007, 0.013], [-0.031, 0.017, 0.029], [0.083, 0.061, -0.047], [0.9, -0.7, 1.1]]
)


def shape_operator(gradient: FloatArray, hessian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit normal (k, 3) and shape operator (k, 3, 3), 1/m, of the level of a function."""
    size = np.linalg.norm(gradient, axis=1)
    normal = gradient / size[:, None]
    tangent = np.eye(3) - normal[:, :, None] * normal[:, None, :]
    return normal, tangent @ hessian @ tangent / size[:, None, None]


def gap_at(
    points: FloatArray, nearest: FloatArray, gradient: FloatArray, hessian: FloatArray
) -> Gap:
    """Signed distance from the nearest points, with its derivatives.

    Parameters
    ----------
    points, nearest : ndarray, shape (k, 3), m.
    gradient, hessian : of g at the nearest points.
    """
    normal, shape = shape_operator(gradient, hessian)
    distance = ((points - nearest) * normal).sum(axis=1)
    bend, axes = np.linalg.eigh(shape)
    bend = bend / np.maximum(1 + distance[:, None] * bend, FOCUS)
    return Gap(distance, normal, (axes * bend[:, None, :]) @ axes.transpose(0, 2, 1))


@dataclass(frozen=True)
class Ellipsoid(Surface):
    """An ellipsoid with axes along x, y and z. Its g is the signed distance.

    Parameters
    ----------
    centre : m.
    semi_axes : along x, y and z, m, > 0.
    inside : whether the inside is the free side (a vault) and not the outside (an egg).
    """

    centre: Vector
    semi_axes: Vector
    inside: bool = False

    def __post_init__(self) -> None:
        require_vector(self, "centre", self.centre)
        require_vector(self, "semi_axes", self.semi_axes)
        require_flags(self, inside=self.inside)
        for axis, length in zip("xyz", self.semi_axes, strict=True):
            require_positive(self, "m", **{f"semi_axes_{axis}": length})

    def project(self, points: FloatArray) -> FloatArray:
        """Nearest points of the ellipsoid, shape (k, 3), m.

        They are p_i = a_i^2 y_i / (t + a_i^2) with the largest root t of sum (p_i / a_i)^2 = 1.
        Newton's steps from below never pass that root, since the sum falls and is convex. The
        unknown is t + min a_i^2, which loses no digits where it is small.
        """
        squared = np.asarray(self.semi_axes, dtype=float) ** 2
        arm = np.asarray(points, dtype=float) - self.centre
        # In a plane of symmetry between the centres of curvature two points are nearest: take one.
        least = 1e-12 * squared.max() ** 0.5
        arm = np.where(np.abs(arm) < least, np.copysign(least, arm), arm)
        scaled = np.sqrt(squared) * np.abs(arm)
        beyond = squared - squared.min()
        root = (scaled - beyond).max(axis=1)
        for _ in range(STEPS):
            size = root[:, None] + beyond
            part = (scaled / size) ** 2
            move = (part.sum(axis=1) - 1) / (2 * (part / size).sum(axis=1))
            root = root + move
            if (np.abs(move) <= 1e-15 * root).all():
                break
        return self.centre + squared * arm / (root[:, None] + beyond)

    def gap(self, points: FloatArray) -> Gap:
        """Signed distance with its derivatives."""
        squared = np.asarray(self.semi_axes, dtype=float) ** 2
        nearest = self.project(points)
        hessian = np.broadcast_to(np.diag(1 / squared), (len(points), 3, 3))
        gap = gap_at(points, nearest, (nearest - self.centre) / squared, hessian)
        if not self.inside:
            return gap
        return Gap(-gap.distance, -gap.normal, -gap.curvature)

    def value(self, points: FloatArray) -> FloatArray:
        """Signed distance, m."""
        return self.gap(points).distance

    def gradient(self, points: FloatArray) -> FloatArray:
        """Return unit vectors along the normals of the nearest points."""
        return self.gap(points).normal

    def hessian(self, points: FloatArray) -> FloatArray:
        """Second derivatives of the signed distance, 1/m."""
        return self.gap(points).curvature


@dataclass(frozen=True, eq=False, init=False)
class Implicit(Surface):
    """The surface on which a function g is zero; g > 0 is the free side.

    g may have any scale and unit; `gap` is the distance from the nearest point of the surface, in
    m. Where no nearest point is found (beyond centres of curvature, where it is not unique) the gap
    is the distance to first order, g / |dg|, with curvature zero.

    Parameters
    ----------
    function : g, either a NumPy function of points (k, 3), m, with values (k,), or a UFL
        expression of the place, e.g. ``lambda x: x[2] - 0.1 * ufl.sin(x[0])``: it is called with a
        UFL vector, and taken for UFL if a UFL scalar comes back. UFL derives exactly.
    gradient : NumPy function of points (k, 3) with values (k, 3). Default: derived by UFL, or by
        differences.
    hessian : NumPy function of points (k, 3) with values (k, 3, 3). Default: derived by UFL, or by
        differences (of `gradient`, if that is given).
    step : of the differences, m, > 0; small against the radii of the surface. They are of fourth
        order: relative errors of 1e-11 with radii of 20 mm and the default step.

    Raises
    ------
    OutOfRange : functions that raise, values of a wrong shape or nowhere finite at a few places
        within 1.6 m of the origin, gradient zero at all of them, step <= 0.
    BadScene : a UFL expression that has no value at a point alone (coefficients, integrals).
    """

    function: Callable[[Any], Any]
    own_gradient: Function | None
    own_hessian: Function | None
    step: float

    def __init__(
        self,
        function: Callable[[Any], Any],
        gradient: Function | None = None,
        hessian: Function | None = None,
        step: float = 1e-4,
    ):
        # Fields have other names than the methods that give the derivatives.
        fields = {"function": function, "own_gradient": gradient, "own_hessian": hessian}
        for name, value in {**fields, "step": step}.items():
            object.__setattr__(self, name, value)
        require_positive(self, "m", step=step)
        for name, value in (("gradient", gradient), ("hessian", hessian)):
            if value is not None and not callable(value):
                raise OutOfRange(f"Implicit.{name}", value, "a function of points (k, 3)")
        count = len(PROBES)
        with np.errstate(all="ignore"):  # not every place need be one where g is defined
            _require_shape("function", self._tried("function", self.value), (count,))
            slope = _require_shape("gradient", self._tried("gradient", self.gradient), (count, 3))
            _require_shape("hessian", self._tried("hessian", self.hessian), (count, 3, 3))
        if not slope[np.isfinite(slope)].any():
            raise OutOfRange("Implicit.function", "constant", "a function that varies")

    def _tried(self, name: str, function: Function) -> FloatArray:
        """Values at a few places."""
        try:
            return function(PROBES)
        except TongueError:
            raise
        except Exception as error:  # whatever a user's function does
            raise OutOfRange(
                f"Implicit.{name}", self.function, f"{KINDS}; it raises {error!r}"
            ) from error

    @cached_property
    def _formulas(self) -> tuple[Formula, list[Formula], list[list[Formula]]] | None:
        """g, its first and second derivatives, if g is a UFL expression."""
        try:
            import ufl

            from dolfin_tongue.surfaces.formula import formula, place
        except ModuleNotFoundError:  # without UFL the function must be one of NumPy
            return None
        x = place()
        try:
            expression = self.function(x)
        except Exception:  # whatever NumPy functions do when they meet a UFL vector
            return None
        if not isinstance(expression, ufl.core.expr.Expr):
            return None
        if expression.ufl_shape:
            raise OutOfRange("shape of Implicit.function in UFL", expression.ufl_shape, "()")
        first = ufl.diff(expression, x)
        second = ufl.diff(first, x)
        return (
            formula(expression),
            [formula(first[i]) for i in range(3)],
            [[formula(second[i, j]) for j in range(i + 1)] for i in range(3)],
        )

    def value(self, points: FloatArray) -> FloatArray:
        """Return g, in its own unit."""
        points = np.asarray(points, dtype=float)
        if self._formulas is not None:
            return self._formulas[0](points)
        return np.asarray(self.function(points), dtype=float)

    def gradient(self, points: FloatArray) -> FloatArray:
        """First derivatives of g, per m."""
        points = np.asarray(points, dtype=float)
        if self.own_gradient is not None:
            return np.asarray(self.own_gradient(points), dtype=float)
        if self._formulas is not None:
            return np.stack([part(points) for part in self._formulas[1]], axis=-1)
        return first_derivatives(self.value, points, self.step)

    def hessian(self, points: FloatArray) -> FloatArray:
        """Second derivatives of g, per m2."""
        points = np.asarray(points, dtype=float)
        if self.own_hessian is not None:
            return np.asarray(self.own_hessian(points), dtype=float)
        if self._formulas is not None:
            hessian: FloatArray = np.empty((len(points), 3, 3))
            for i, row in enumerate(self._formulas[2]):
                for j, part in enumerate(row):
                    hessian[:, i, j] = hessian[:, j, i] = part(points)
            return hessian
        if self.own_gradient is None:
            return second_derivatives(self.value, points, self.step)
        hessian = first_derivatives(self.gradient, points, self.step)
        return 0.5 * (hessian + hessian.transpose(0, 2, 1))

    def gap(self, points: FloatArray) -> Gap:
        """Signed distance from the nearest point, with its derivatives."""
        points = np.asarray(points, dtype=float)
        with np.errstate(all="ignore"):  # points for which no nearest one is found
            nearest, found = self._nearest(points)
            gap = gap_at(points[found], nearest[found], *self._slopes(nearest[found]))
            size = np.linalg.norm(slope := self.gradient(points), axis=1)
            distance, normal = self.value(points) / size, slope / size[:, None]
        curvature = np.zeros((len(points), 3, 3))
        distance[found], normal[found], curvature[found] = gap.distance, gap.normal, gap.curvature
        return Gap(distance, normal, curvature)

    def _slopes(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.gradient(points), self.hessian(points)

    def _nearest(self, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Nearest points of the surface, and whether they were found.

        Newton's steps for p + l dg(p) = y, g(p) = 0, from the point along the gradient. Where y
        lies beyond a centre of curvature of p they would lead to a furthest point; there the
        surface is taken for flat.
        """
        near, active = self.project(points), np.arange(len(points))
        found = np.zeros(len(points), dtype=bool)
        for _ in range(STEPS):
            move, nearest = self._step_to_nearest(points[active], near[active])
            near[active] += move
            arm = np.linalg.norm(points[active] - near[active], axis=1)
            still = np.linalg.norm(move, axis=1) <= CLOSE * (1e-3 + arm)
            found[active[still]] = nearest[still]
            active = active[~still & np.isfinite(move).all(axis=1)]
            if not len(active):
                break
        return near, found

    def _step_to_nearest(
        self, points: FloatArray, near: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """One of Newton's steps, shape (k, 3), m, and whether it leads to a nearest point."""
        gradient, hessian = self._slopes(near)
        normal, shape = shape_operator(gradient, hessian)
        arm = points - near
        distance = (arm * normal).sum(axis=1)
        height = self.value(near) / np.linalg.norm(gradient, axis=1)
        bend, axes = np.linalg.eigh(np.nan_to_num(shape))
        stretch = 1 + distance[:, None] * bend
        nearest = stretch > FOCUS
        stretch = np.where(nearest, stretch, 1.0)
        along = arm - distance[:, None] * normal
        local = (axes.transpose(0, 2, 1) @ along[:, :, None])[:, :, 0] / stretch
        sideways = (axes @ local[:, :, None])[:, :, 0]
        return sideways - height[:, None] * normal, nearest.all(axis=1)


def _require_shape(name: str, values: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return values if they have the shape and some are finite."""
    if values.shape != shape:
        what = f"shape of Implicit.{name} at {shape[0]} points"
        raise OutOfRange(what, values.shape, f"{shape}; g is {KINDS}")
    if not np.isfinite(values).any():
        raise OutOfRange(f"Implicit.{name}", values, "finite numbers, at some places at least")
    return values
