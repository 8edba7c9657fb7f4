"""Muscles, palate, moving mandible, hyoid and gravity in one scene; with --data the published one.

The tongue sags to rest, the mandible opens and closes again while genioglossus and styloglossus
lift the tongue against the palate. With --data the published tongue does the same between its own
palate, jaw and hyoid.
"""

from math import degrees

from dolfin_tongue.anatomy.bones import GLIDE, OPENING
from dolfin_tongue.anatomy.scenes import published_mouth, report_mouth
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.app.pictures import read_table
from dolfin_tongue.control import Recorded, SmoothRamp
from dolfin_tongue.scene.scene import Scene

END = 0.6
#: Share of 10 degrees of opening over time, s.
TIMES, SHARES = (0.0, 0.1, 0.25, 0.45, 0.6), (0.0, 0.0, 0.6, -0.1, -0.1)
REPORT_MUSCLES = {"genioglossus_posterior": 1.0, "styloglossus": 0.6}
PUBLISHED_MUSCLES = {"GGP": 0.3, "STY": 0.2}


def scene_of(options: Options) -> Scene:
    """Build the scene, with the published tongue where its data are named."""
    coordinates = zip(("x", "z", "angle"), (*GLIDE, OPENING), strict=True)
    motion = {name: Recorded(TIMES, tuple(s * x for s in SHARES)) for name, x in coordinates}
    pull = SmoothRamp(0.1, 0.2, 0.2)
    muscles = PUBLISHED_MUSCLES if options.data else REPORT_MUSCLES
    activation = {name: SmoothRamp(level, 0.2, 0.2) for name, level in muscles.items()}
    if options.data:
        return published_mouth(options.data, activation, motion=motion, geniohyoid=pull)
    return report_mouth(
        activation, refinement=options.refinement, motion=motion, geniohyoid=pull
    )  # fmt: skip


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    scene = scene_of(options)
    print(f"{scene.body.name} of {scene.body.cell_count} elements in a mouth")
    run = play(scene, END, options, 5e-3, "muscles, palate, mandible, hyoid and gravity")
    steps = read_table(options.folder / "steps.csv")
    rows: dict[str, object] = {
        f"{bone.name} at the end": f"back {1e3 * x:+.2f} mm, up {1e3 * z:+.2f} mm, "
        f"turned {degrees(angle):+.2f} degrees"
        for bone, (x, z, angle) in zip(scene.rigid_bodies, run.last.rigid, strict=True)
    }
    return rows | {
        "largest area in contact, mm2": 1e6 * float(steps["contact_area_m2"].max()),
        "smallest gap of all steps, mm": 1e3 * float(steps["contact_gap_m"].min()),
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "simulated seconds per wall second": run.summary["simulated_seconds_per_wall_second"],
    }
