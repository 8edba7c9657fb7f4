"""Each muscle of the report's tongue alone at 50 %: one table and one sheet of final shapes.

Every run starts from rest under gravity; the table gives how far tip, dorsum and back move from
there. x points back, z up: a negative x is forward.
"""

from dolfin_tongue.anatomy.scenes import report_tongue
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.app.pictures import picture_shapes
from dolfin_tongue.base.files import write_text
from dolfin_tongue.control import Ramp
from dolfin_tongue.geometry.preliminary import preliminary_tongue

END = 0.8
ACTIVATED_AT = 0.4
LANDMARKS = ("tip", "dorsum", "back", "body")
TOGETHER = ("transversalis", "verticalis")


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the table."""
    body = preliminary_tongue(options.refinement)
    cases = {name: (name,) for name in body.fibres.names} | {" + ".join(TOGETHER): TOGETHER}
    shapes, moved = {}, {}
    for case, muscles in cases.items():
        activation = {name: Ramp(0.5, ACTIVATED_AT) for name in muscles}
        scene = report_tongue(activation, body=body)
        folder = options.folder / case.replace(" + ", "_")
        run = play(scene, END, options, 5e-3, case, folder=folder, draw=None)
        rest = min(run.frames, key=lambda frame: abs(frame.time - ACTIVATED_AT))
        shapes[case] = run.last
        moved[case] = {
            name: 1e3 * (run.last.displacement - rest.displacement)[body.landmark(name)]
            for name in LANDMARKS
        }
    _write_table(options, moved)
    if options.pictures:
        picture_shapes(body, shapes, options.folder / "final_shapes.png")
    print("displacement from rest under gravity in mm, x to the back and z up:")
    return {
        case: {f"{name} {'xyz'[i]}": f"{x[i]:+.1f}" for name, x in row.items() for i in (0, 2)}
        for case, row in moved.items()
    }


def _write_table(options: Options, moved: dict) -> None:
    columns = [f"{name}_{axis}_mm" for name in LANDMARKS for axis in "xyz"]
    rows = [",".join(["muscle", *columns])]
    for case, row in moved.items():
        rows.append(",".join([case, *(f"{v:.4f}" for x in row.values() for v in x)]))
    write_text(options.folder / "moved.csv", "\n".join(rows) + "\n")
