"""Curves of the constitutive laws: passive stress, active stress (report, figures 4 to 8).

The passive stress here is dW/dE of the law (67) alone, as the report plots it; the numbers that
are returned say how well it agrees with what UFL derives from the class that simulations use.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import ufl

from dolfin_tongue.base.arrays import FloatArray
from dolfin_tongue.base.units import kPa
from dolfin_tongue.constitutive import SPECIFIC_TENSION, ReportTissue, StressMobilisation
from dolfin_tongue.view.plots import COLOURS, new_figure, save_figure, style

TISSUE, MUSCLE = ReportTissue(), StressMobilisation()

#: Other mobilisation functions of the form (74) to compare with the report's model 1.
OTHERS = {"a = 2, b = 4": (2.0, 4.0), "a = 5, b = 5": (5.0, 5.0)}


def plane_strain(stretch: FloatArray, shear: FloatArray) -> FloatArray:
    """Green strain of the isochoric stretch and shear in a plane (72), shape (..., 3, 3)."""
    zero = np.zeros_like(stretch * shear)
    rows = [
        [stretch**2 + zero, stretch * shear, zero],
        [stretch * shear, 1 / stretch + shear**2, zero],
        [zero, zero, 1 / stretch + zero],
    ]
    return (np.moveaxis(np.array(rows), (0, 1), (-2, -1)) - np.eye(3)) / 2


def passive_stress(strain: FloatArray, law: ReportTissue = TISSUE) -> FloatArray:
    """Second Piola-Kirchhoff stress dW/dE of (67), Pa.

    With dJ1/dE = I and dJ2/dE = E - J1 I,
    S = a0 exp(a1 J1^2 + a2 J2) (2 a1 J1 I + a2 (E - J1 I)).

    Parameters
    ----------
    strain : ndarray, shape (..., 3, 3) -- Green strain E of an isochoric deformation.
    law : its constants.
    """
    first = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
    square = (strain**2).sum(axis=(-2, -1))[..., None, None]
    exponent = law.a1 * first**2 + law.a2 * (square - first**2) / 2
    direction = 2 * law.a1 * first * np.eye(3) + law.a2 * (strain - first * np.eye(3))
    return law.a0 * np.exp(exponent) * direction


def derived_stress(strain: FloatArray, law: ReportTissue = TISSUE) -> FloatArray:
    """Return the same for one strain, shape (3, 3), from the class's energy, derived by UFL."""
    variable = ufl.variable(ufl.as_matrix(strain.tolist()))
    fields = SimpleNamespace(value=lambda value: value)
    energy = law.energy_density(SimpleNamespace(E_iso=variable), fields)
    stress = ufl.diff(energy, variable)
    return np.array([[float(stress[i, j](())) for j in range(3)] for i in range(3)])


def passive_tension(stretch: FloatArray) -> FloatArray:
    """Cauchy stress of a simple isochoric stretch with free sides, Pa.

    The pressure that keeps the volume follows from the free sides: t = C11 S11 - C22 S22.
    """
    strain = plane_strain(stretch, np.zeros_like(stretch))
    stress = passive_stress(strain)
    return stretch**2 * stress[..., 0, 0] - stress[..., 1, 1] / stretch


def active_tension(stretch: FloatArray, rate: FloatArray, activation: float) -> FloatArray:
    """Active Cauchy stress along the fibres (73), Pa; rate in 1/s."""
    factors = MUSCLE.length_factor(stretch) * MUSCLE.rate_factor(rate)
    return SPECIFIC_TENSION * activation * factors


def main(options: Any) -> dict[str, float]:
    """Draw the figures and return what a test can check.

    Parameters
    ----------
    options : what `dolfin_tongue.app.demo` gives, or the folder for the pictures itself.
    """
    folder = Path(getattr(options, "folder", options))
    with style():
        passive_surfaces(folder / "fig4_passive_stress.png")
        mobilisation(folder / "fig5_stress_mobilisation.png")
        rate_dependence(folder / "fig6_rate_dependence.png")
        active_surfaces(folder / "fig7_active_stress.png")
        total_tension(folder / "fig8_passive_and_total.png")
    return numbers()


def numbers() -> dict[str, float]:
    """Values of the curves at points where they are known."""
    grid = np.linspace(0.5, 1.6, 1101)
    strain = plane_strain(np.array(1.3), np.array(0.4))
    derived = derived_stress(strain)
    error = np.abs(passive_stress(strain) - derived).max() / np.abs(derived).max()
    return {
        "f_at_1": float(MUSCLE.length_factor(1.0)),
        "stretch_of_largest_f": float(grid[np.argmax(MUSCLE.length_factor(grid))]),
        "g_at_0": float(MUSCLE.rate_factor(0.0)),
        "g_at_-25": float(MUSCLE.rate_factor(-25.0)),
        "passive_stress_at_rest_Pa": float(np.abs(passive_stress(np.zeros((3, 3)))).max()),
        "passive_against_UFL": float(error),
    }


def surface_axes(figure: Any, place: Any, title: str, label: str) -> Any:
    """Make three-dimensional axes in the look of the others."""
    axes = figure.add_subplot(place, projection="3d")
    axes.set(title=title, zlabel=label)
    axes.view_init(elev=22, azim=-125)
    axes.locator_params(nbins=5)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.98))
    axes.set_box_aspect((1, 1, 0.75), zoom=0.88)
    return axes


def draw_surface(axes: Any, x: FloatArray, y: FloatArray, z: FloatArray, **how: Any) -> None:
    """Draw a surface with thin lines of its grid."""
    axes.plot_surface(x, y, z, rstride=2, cstride=2, edgecolor="#00000050", lw=0.4, **how)


def draw_above(axes: Any, x: FloatArray, y: FloatArray, z: FloatArray, colour: str) -> None:
    """Draw a surface that lies above another as a net that one looks through."""
    axes.plot_surface(x, y, z, color=colour, alpha=0.14, shade=False)
    axes.plot_wireframe(x, y, z, rstride=4, cstride=4, color=colour, lw=0.9)


def passive_surfaces(path: Path) -> None:
    """Figure 4: S11 and S12 of the isochoric stretch and shear (72)."""
    stretch, shear = np.meshgrid(np.linspace(0.7, 1.5, 41), np.linspace(-0.5, 0.5, 41))
    stress = passive_stress(plane_strain(stretch, shear)) / kPa
    figure = new_figure(11, 4.8)
    for place, (i, j) in zip((121, 122), ((0, 0), (0, 1)), strict=True):
        label = f"S{i + 1}{j + 1}, kPa"
        axes = surface_axes(figure, place, f"Passive stress S{i + 1}{j + 1}", label)
        draw_surface(axes, stretch, shear, stress[..., i, j], cmap="viridis")
        axes.set(xlabel="stretch", ylabel="shear")
    save_figure(figure, path)


def mobilisation(path: Path) -> None:
    """Figure 5: stress mobilisation over fibre stretch."""
    stretch = np.linspace(0.2, 2.0, 361)
    figure = new_figure(7.5, 4.6)
    axes = figure.add_subplot()
    label = f"model 1 of the report: a = {MUSCLE.a:g}, b = {MUSCLE.b:g}"
    axes.plot(stretch, MUSCLE.length_factor(stretch), color=COLOURS[0], lw=2.6, label=label)
    for (name, (a, b)), colour in zip(OTHERS.items(), COLOURS[1:], strict=False):
        law = StressMobilisation(a=a, b=b)
        axes.plot(stretch, law.length_factor(stretch), color=colour, label=name)
    # Thelen (2003), J. Biomech. Eng. 125:70-77, for the curve that Zajac (1989) draws.
    bell = np.exp(-((stretch - 1) ** 2) / 0.45)
    axes.plot(stretch, bell, "--", color=COLOURS[3], label="whole muscle, exp(-(x - 1)²/0.45)")
    axes.axvline(1.0, color="#55555c", lw=0.8)
    axes.set(
        xlabel="fibre stretch", ylabel="f(stretch, 1)", title="Stress mobilisation", ylim=(0, 1.4)
    )
    axes.legend(loc="upper right")
    save_figure(figure, path)


def rate_dependence(path: Path) -> None:
    """Figure 6: dependence of the active stress on the rate of stretch."""
    rate = np.linspace(-60, 60, 241)
    figure = new_figure(7.5, 4.2)
    axes = figure.add_subplot()
    axes.plot(rate, MUSCLE.rate_factor(rate), color=COLOURS[0], lw=2.6)
    for x, y in ((0.0, MUSCLE.y0), (-MUSCLE.rate1, MUSCLE.y1)):
        axes.plot(x, y, "o", color=COLOURS[1], ms=7)
        text = f"g({x:g}) = {y:g}"
        axes.annotate(text, (x, y), (12, -4), textcoords="offset points", va="top")
    axes.set(
        xlabel="rate of fibre stretch, 1/s (negative: shortening)", ylabel="g", ylim=(0, 1.05),
        title="Shortening weakens the muscle, lengthening strengthens it",
    )  # fmt: skip
    save_figure(figure, path)


def active_surfaces(path: Path) -> None:
    """Figure 7: active stress over stretch and rate for two activations."""
    stretch, rate = np.meshgrid(np.linspace(0.4, 1.8, 57), np.linspace(-50, 50, 41))
    figure = new_figure(7.5, 6)
    axes = surface_axes(figure, 111, "Active stress at activation 0.25 and 1", "stress, kPa")
    quarter, whole = (active_tension(stretch, rate, level) / kPa for level in (0.25, 1.0))
    draw_surface(axes, stretch, rate, quarter, color=COLOURS[5], shade=False)
    draw_above(axes, stretch, rate, whole, COLOURS[1])
    axes.set(xlabel="fibre stretch", ylabel="rate, 1/s")
    axes.view_init(elev=22, azim=-60)
    save_figure(figure, path)


def total_tension(path: Path, activation: float = 0.1) -> None:
    """Figure 8: passive stress and, above it, passive plus active stress."""
    stretch, rate = np.meshgrid(np.linspace(0.6, 1.6, 41), np.linspace(-50, 50, 41))
    passive = passive_tension(stretch)
    total = passive + active_tension(stretch, rate, activation)
    figure = new_figure(11, 5)
    axes = surface_axes(figure, 121, "Tension along the fibres", "stress, kPa")
    draw_surface(axes, stretch, rate, passive / kPa, color=COLOURS[2], shade=False)
    draw_above(axes, stretch, rate, total / kPa, COLOURS[1])
    axes.set(xlabel="fibre stretch", ylabel="rate, 1/s")
    axes.view_init(elev=22, azim=-60)
    line = np.linspace(0.5, 1.6, 221)
    section = figure.add_subplot(122)
    section.plot(line, passive_tension(line) / kPa, color=COLOURS[2], label="passive")
    still = passive_tension(line) + active_tension(line, np.zeros_like(line), activation)
    section.plot(line, still / kPa, color=COLOURS[1], label=f"with activation {activation:g}")
    section.axhline(0.0, color="#55555c", lw=0.8)
    section.set(xlabel="fibre stretch", ylabel="stress, kPa", title="The same at rate 0")
    section.legend()
    save_figure(figure, path)


if __name__ == "__main__":
    for name, value in main(Path("results") / "laws").items():
        print(f"{name:28} {value:.6g}")
