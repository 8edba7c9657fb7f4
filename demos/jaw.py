"""The mandible opens by 10 degrees in 200 ms and carries the report's tongue along.

The tongue rests under gravity between mandible and hyoid for 200 ms. Then the mandible follows a
prescribed motion, while the hyoid moves freely in its ligaments: the tissue pulls it along.
"""

from math import degrees

from dolfin_tongue.anatomy.bones import opening
from dolfin_tongue.anatomy.scenes import report_mouth
from dolfin_tongue.app.demo import Options, play

END = 0.6
OPENS_AT = 0.2


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    scene = report_mouth(
        {}, ("mandible", "hyoid"), options.refinement, motion=opening(OPENS_AT, 0.2)
    )
    print(f"tongue of {scene.body.cell_count} elements on a mandible and a hyoid")
    run = play(scene, END, options, 2.5e-3, "the mandible opens by 10 degrees")
    tip = 1e3 * run.last.displacement[scene.body.landmark("tip")]
    rows: dict[str, object] = {"tip moved, mm": f"back {tip[0]:+.2f}, up {tip[2]:+.2f}"}
    for bone, (x, z, angle) in zip(scene.rigid_bodies, run.last.rigid, strict=True):
        rows[f"{bone.name} moved"] = (
            f"back {1e3 * x:+.2f} mm, up {1e3 * z:+.2f} mm, turned {degrees(angle):+.2f} degrees"
        )
    return rows | {
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "energy balance error / exchanged energy": run.summary["balance_error_per_exchanged"],
        "simulated seconds per wall second": run.summary["simulated_seconds_per_wall_second"],
    }
