"""Gravity, then all eight muscles: the report's tongue of 42 elements (fig. 27).

For 500 ms the tongue sags to rest under gravity. Then all eight muscles are activated in the same
way, to 50 % within 100 ms, and the tongue moves to another equilibrium.
"""

from dolfin_tongue.anatomy.scenes import report_tongue
from dolfin_tongue.app.demo import Options, play
from dolfin_tongue.control import SmoothRamp
from dolfin_tongue.geometry.preliminary import preliminary_tongue

END = 1.0
ACTIVATED_AT = 0.5
LEVEL = 0.5


def main(options: Options) -> dict[str, object]:
    """Run the demo; returns the numbers worth printing."""
    body = preliminary_tongue(options.refinement)
    activation = {name: SmoothRamp(LEVEL, ACTIVATED_AT, 0.1) for name in body.fibres.names}
    scene = report_tongue(activation, body=body)
    low, high = body.scaled_jacobians.min(), body.scaled_jacobians.max()
    print(
        f"tongue of {body.cell_count} elements, {body.volumes.sum() * 1e6:.1f} cm3, "
        f"scaled Jacobian {low:.2f} to {high:.2f}; compiling its forms on first use ..."
    )
    run = play(scene, END, options, 2.5e-3, "gravity, then all eight muscles at 50 %")
    node = body.landmark("tip")
    tip = 1e3 * run.last.displacement[node]
    return {
        "tip moved, mm": f"back {tip[0]:+.2f}, up {tip[2]:+.2f}",
        "largest relative volume change of a cell": run.summary["max_volume_change"],
        "largest |det F - 1| at a quadrature point": run.summary["max_local_volume_change"],
        "energy balance error / exchanged energy": run.summary["balance_error_per_exchanged"],
        "wall time of the solver, s": run.summary["solving_wall_s"],
        "simulated seconds per wall second": run.summary["simulated_seconds_per_wall_second"],
    }
