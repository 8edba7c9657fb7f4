"""The report's tongue is pressed to the palate by posterior genioglossus and styloglossus.

Both muscles rise within 300 ms. The gap between tongue and palate closes from the sides of the
dorsum, the patch in contact grows, and neither comes through the other.
"""

from dolfin_tongue.anatomy.scenes import report_mouth
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.app.pictures import read_table
from dolfin_tongue.control import SmoothRamp

END = 0.5
LEVELS = {"genioglossus_posterior": 1.0, "styloglossus": 0.6}


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    activation = {name: SmoothRamp(level, 0.0, 0.3) for name, level in LEVELS.items()}
    scene = report_mouth(activation, ("palate",), 2 * options.refinement)  # a patch needs cells
    print(f"tongue of {scene.body.cell_count} elements under a palate")
    run = play(
        scene,
        END,
        options,
        2.5e-3,
        "pressed to the palate by genioglossus posterior and styloglossus",
    )
    steps = read_table(options.folder / "steps.csv")
    area = steps["contact_area_m2"]
    touched = steps["time_s"][area > 0]
    return {
        "first contact, s": float(touched[0]) if touched.size else "none",
        "area in contact at the end, mm2": 1e6 * float(area[-1]),
        "force of the palate (x, y, z), N": " ".join(
            f"{steps[f'contact_force_{axis}_N'][-1]:.3f}" for axis in "xyz"
        ),
        "largest pressure at the end, kPa": 1e-3 * float(steps["contact_pressure_Pa"][-1]),
        "smallest gap of all steps, mm": 1e3 * float(steps["contact_gap_m"].min()),
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "simulated seconds per wall second": run.summary["simulated_seconds_per_wall_second"],
    }
