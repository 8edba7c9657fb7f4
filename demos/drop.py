"""A free cube of liquid becomes a drop: 64 elements, surface tension and viscosity only (fig. 10).

The report takes coefficients some 1000 times those of water, for a large volume. What counts is the
time sqrt(rho R^3 / sigma), 0.4 s for these 8 cm3 of a liquid with a seventh of the surface tension
of water and 30 times its viscosity. A cube is a drop in mode 4: it overshoots into an octahedron.
"""

from dataclasses import replace

import numpy as np

from dolfin_tongue import view
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.app.pictures import SHEET_FRAMES, read_table
from dolfin_tongue.body.body import Body
from dolfin_tongue.body.faces import areas
from dolfin_tongue.boundary import SurfaceTension
from dolfin_tongue.constitutive import Viscosity
from dolfin_tongue.direct import Model, TrBdf2, drift
from dolfin_tongue.geometry.simple import block_body
from dolfin_tongue.march.solver import Method
from dolfin_tongue.record.run import Run
from dolfin_tongue.scene.scene import Scene

EDGE = 0.02  # m
SIGMA = 0.01  # N/m
ETA = 0.03  # Pa s
END = 1.0


def cube(refinement: int = 1) -> Body:
    """Cube of water around the origin, 4 x 4 x 4 elements at refinement 1."""
    body = block_body((EDGE,) * 3, (4 * refinement,) * 3, density=1000.0, name="drop")
    return replace(body, points=body.points - EDGE / 2)


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    scene = Scene(cube(options.refinement), (Viscosity(ETA), SurfaceTension(SIGMA)))
    print(f"a cube of {scene.body.cell_count} elements under surface tension, free in space")
    run = play(
        scene, END, options, 5e-3, "a cube becomes a drop",
        method=method_of(options), frame_interval=0.01, draw=draw,
    )  # fmt: skip
    return numbers(run)


def method_of(options: Options) -> Method:
    """Choose steps; the direct solver's default tolerance, made for tissue, is noise of 0.1 Pa."""
    method = options.method(5e-3)
    return replace(method, newton=1e-10) if isinstance(method, TrBdf2) else method


def numbers(run: Run) -> dict[str, object]:
    """Compare the last shape with a sphere of the same volume."""
    body, last = run.scene.body, run.last
    place = body.points + last.displacement
    volume = body.volumes.sum()
    radius = (3 * volume / (4 * np.pi)) ** (1 / 3)
    outer = place[np.unique(body.boundary)]
    distance = np.linalg.norm(outer - outer.mean(axis=0), axis=1)
    area = areas(place, body.boundary).sum()
    pressure = (last.pressure * body.volumes).sum() / volume
    kept = drift(Model(run.scene), run.frames)
    return {
        "mean pressure / (2 sigma / R)": pressure / (2 * SIGMA / radius),
        "area / area of the sphere, at the start": 6 * EDGE**2 / (4 * np.pi * radius**2),
        "area / area of the sphere, at the end": area / (4 * np.pi * radius**2),
        "distance of outer nodes from the centre / R": (
            f"{distance.min() / radius:.3f} to {distance.max() / radius:.3f}"
        ),
        "drift of momentum, of the largest": kept.momentum,
        "drift of angular momentum, of the largest": kept.angular_momentum,
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "largest |det F - 1| at a quadrature point": run.summary["max_local_volume_change"],
        "energy balance error / exchanged energy": run.summary["balance_error_per_exchanged"],
        "wall time of the solver, s": run.summary["solving_wall_s"],
    }


def draw(run: Run, title: str) -> None:
    """Draw a sheet of frames, a film, the last shape and the energies."""
    body, folder = run.scene.body, run.folder
    frames = view.key_frames(run.frames, SHEET_FRAMES)
    view.contact_sheet(body, frames, folder / "sheet.png", title=title)
    view.animation(body, run.frames, folder / "animation.gif")
    view.shape_picture(body, run.last, folder / "shape.png")
    view.energy_plot(read_table(folder / "steps.csv"), folder / "energy.png")
