"""The published tongue of 740 elements: gravity, then the posterior genioglossus (needs --data).

Its mesh, muscles and attachments are read from a folder with tongue.vtu, muscles.json and
attachments.json. It rests under gravity for 200 ms before GGP rises to 50 % within 50 ms.
"""

from dolfin_tongue.anatomy.scenes import published_scene
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.control import Ramp
from dolfin_tongue.geometry.published import published_tongue

END = 0.5
ACTIVATED_AT = 0.2


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    folder = options.need_data()
    body = published_tongue(folder)
    scene = published_scene(folder, {"GGP": Ramp(0.5, ACTIVATED_AT)}, body)
    run = play(scene, END, options, 5e-3, "published tongue: gravity, then GGP at 50 %")
    marks = {node: name for name, node in body.landmarks.items()}  # each node once
    moved = {name: 1e3 * run.last.displacement[node] for node, name in marks.items()}
    return {
        f"{name} moved (x, y, z), mm": " ".join(f"{x:.2f}" for x in displacement)
        for name, displacement in moved.items()
    } | {
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "largest |det F - 1| at a quadrature point": run.summary["max_local_volume_change"],
        "smallest det F at a quadrature point": run.summary["smallest_det_F"],
        "simulated seconds per wall second": run.summary["simulated_seconds_per_wall_second"],
    }
