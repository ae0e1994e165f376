"""catenary gravity, track and hold."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from catenary.cli.conditions import Conditions
from catenary.cli.gravity_source import GivenGravity, SensingOptions
from catenary.cli.joint_options import Q, QDeg, SameInDeg, beyond_limits, given_joints, joint_values
from catenary.cli.options import AsJsonNotTables, robots_beginning
from catenary.cli.out_files import PAGE, Report, refuse_outputs
from catenary.cli.robots import DescriptionOptions, Robot
from catenary.cli.terminal import (
    print_json,
    print_notes,
    print_table,
    words,
)
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.control.loop_report import Holding, Tracking
    from catenary.robots.model import RobotModel

SHOWN_POSES = 9  # of a motion, in its report
Simulated = Annotated[
    str,
    Argument(
        metavar="ROBOT",
        help="raven2 or raven2_right, simulated with their cables, or any other robot, as rigid bodies.",
        autocompletion=robots_beginning,
    ),
]


def gravity(
    robot: Robot,
    given: GivenGravity,
    description: DescriptionOptions,
    q: Q = None,
    q_deg: QDeg = None,
    latex: Annotated[
        bool, Option("--latex", help="Print the torques as formulas of the joints, for LaTeX, without --q.")
    ] = False,
    as_json: AsJsonNotTables = False,
) -> None:
    """Print the torques that hold an arm still under gravity.

    On a base that is tilted, or under any vector; beside it the torques on a level base.

    Example: catenary gravity raven2 --q 0,1.57,0.32 --base-tilt-deg 0,20
    """
    from catenary.gravity.torque import gravity_torque, unseen_torque
    from catenary.spatial import LEVEL
    from catenary.units import TORQUE_UNIT

    gravity = given.told("gravity")
    model = description.load(robot)
    model.require_masses()
    if latex:
        if as_json or q is not None or q_deg is not None:
            raise InputError("gravity: --latex goes without --q, --q-deg and --json")
        from catenary.gravity.compact_regressor import gravity_latex

        print_notes(given.doubts(gravity))
        print(gravity_latex(model, gravity))
        return
    values = joint_values(model, q, q_deg)
    torques, on_level = (gravity_torque(model, values, vector).tolist() for vector in (gravity, LEVEL))
    units = [TORQUE_UNIT[unit] for unit in model.joint_units]
    open_to = unseen_torque(model, values, gravity)
    print_notes([*beyond_limits(model, values), *given.doubts(gravity), *_unseen(model, open_to)])
    if as_json:
        found = {"robot": model.name, "joints": model.joint_names, "q": list(values), "gravity": gravity}
        print_json({**found, "tau": torques, "unit": units, "level": on_level, "unseen": open_to.tolist()})
        return
    rows = [
        [name, f"{tau:.4f}", f"{level:.4f}", f"{tau - level:+.4f}", unit]
        for name, tau, level, unit in zip(model.joint_names, torques, on_level, units, strict=True)
    ]
    shown = ", ".join(f"{v:.4g}" for v in gravity)
    axes = "base axes" if model.base == "base" else f"axes of {model.base}"
    print_table(
        f"{model.name}: what holds it still under gravity ({shown}) m/s2 in {axes}",
        ["joint", "torque", "level base", "difference", "unit"],
        rows,
    )


def _unseen(model: "RobotModel", open_to: "Floats") -> list[str]:
    """Return a note on torques that the recordings of an identified robot did not show, with their size."""
    from catenary.units import TORQUE_UNIT

    sizes = [
        f"{name} by up to {size:.2g} {TORQUE_UNIT[unit]}"
        for name, unit, size in zip(model.joint_names, model.joint_units, open_to, strict=True)
        if size > 0.005
    ]
    if not sizes:
        return []
    hidden = ", ".join(each.name for each in model.unseen)
    return [
        f"{model.name} was identified on one base, which does not show {hidden}: under this gravity torques may be "
        f"off, {', '.join(sizes)}; recordings on a tilted base show it"
    ]


def track(
    robot: Simulated,
    conditions: Conditions,
    sensing: SensingOptions,
    description: DescriptionOptions,
    controller: Annotated[
        str,
        Option(
            metavar="NAME",
            help="pd, sg (PD and gravity of a level base), dg (PD and sensed gravity), inertia, computed-torque, "
            "elastic-constant, elastic-online or elastic-biased.",
        ),
    ] = "dg",
    motion: Annotated[
        str,
        Option(
            metavar="NAME",
            help="cartesian (sinusoids of the tip along x, y, z), random, or poses (at rest along joint 1's range).",
        ),
    ] = "cartesian",
    q: Annotated[
        str | None, Option(metavar="Q,Q,...", help="Joints where a cartesian motion begins, in rad and m.")
    ] = None,
    q_deg: SameInDeg = None,
    amplitude_mm: Annotated[float, Option(metavar="A", min=0.0, help="Amplitude of the sinusoids.")] = 78.74,
    axes: Annotated[str, Option(metavar="A,A,...", help="Base axes that the sinusoids run along.")] = "x,y,z",
    seconds: Annotated[float, Option(metavar="S", min=2.0, help="Length of the random motion.")] = 20.0,
    damping: Annotated[
        str,
        Option(
            metavar="KIND",
            help="relative, to the motion's velocity, or absolute, as RAVEN-II's own control: it then lags.",
        ),
    ] = "relative",
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Let a simulated arm follow a motion.

    Prints the joint errors and the PD term's share of the torque; with a sensor also how gravity was known.

    Example: catenary track raven2 --controller sg --base-tilt-deg 0,20 --motion poses
    Example: catenary track raven2 --rock x,8,0.1 --rock y,4,0.14 --heave 2,0.12 --mounting-on ship --motion random
    """
    import numpy as np

    from catenary.workflows.gravity.controllers import make_controller
    from catenary.workflows.gravity.motions import make_motion
    from catenary.workflows.gravity.trials import track as run

    refuse_outputs({"--report": (report, PAGE)})
    if controller in ("inertia", "computed-torque") and (conditions.kp or conditions.kd):
        raise InputError(
            f"--kp and --kd: {controller} has gains of accelerations; they go with pd, sg, dg, elastic-*"
        )
    arm = conditions.arm(robot, description)
    law = make_controller(controller, arm, damping=damping)  # type: ignore[arg-type]  # refuses what it does not know
    chosen = make_motion(
        motion, arm.model, arm.plant, np.random.default_rng(conditions.seed or 0),
        q_start=given_joints(arm.model, q, q_deg), amplitude=amplitude_mm / 1000.0, axes=words(axes), seconds=seconds,
    )  # fmt: skip
    source, felt = conditions.gravity(arm, sensing), arm.plant.measured_js().gravity
    result = run(arm, law, chosen.trajectory, windows=chosen.windows, gravity=source)
    settings = {"robot": robot, "controller": controller, "motion": motion, "damping": damping}
    title = f"{robot} (simulated), controller {controller}, {motion}"
    times = np.linspace(0.0, chosen.trajectory.duration, SHOWN_POSES)
    poses = np.array([chosen.trajectory(time).q for time in times])
    shown = arm.model, poses, felt, "at the beginning of the motion, and at times along it"
    _conclude(title, result, settings | conditions.as_data() | sensing.as_data(), report, as_json, shown)


def hold(
    robot: Simulated,
    conditions: Conditions,
    sensing: SensingOptions,
    description: DescriptionOptions,
    q: Q = None,
    q_deg: QDeg = None,
    controller: Annotated[
        str, Option(metavar="NAME", help="sg (gravity of a level base) or dg (sensed gravity).")
    ] = "dg",
    seconds: Annotated[float, Option(metavar="S", help="How long to watch.")] = 10.0,
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Let gravity compensation alone hold an arm.

    A simulated one; prints how far each joint drifts.

    Example: catenary hold raven2 --base-tilt-deg 0,180 --seconds 2
    """
    from catenary.workflows.gravity.controllers import make_hold
    from catenary.workflows.gravity.motions import HOLD_START, start_pose
    from catenary.workflows.gravity.trials import hold as run

    refuse_outputs({"--report": (report, PAGE)})
    arm = conditions.arm(robot, description)
    law, pose = make_hold(controller, arm), given_joints(arm.model, q, q_deg)
    if pose is None:
        pose = start_pose(arm.model, arm.plant, HOLD_START)
    felt = arm.plant.measured_js().gravity
    result = run(arm, law, pose, seconds, gravity=conditions.gravity(arm, sensing))
    settings = {"robot": robot, "controller": controller}
    title = f"{robot} (simulated), held by {controller} for {seconds:g} s"
    shown = arm.model, result.q_true[[0, -1]], felt, "where it was put, and, paler, at the end"
    _conclude(title, result, settings | conditions.as_data() | sensing.as_data(), report, as_json, shown)


def _conclude(
    title: str,
    result: "Tracking | Holding",
    settings: Mapping[str, Any],
    report: Path | None,
    as_json: bool,
    shown: "tuple[RobotModel, Floats, Floats, str]",
) -> None:
    from catenary.reports.gravity import gravity_table, write_gravity_report

    if report is not None:
        from catenary.reports.robot_plot import robot_picture

        model, poses, felt, when = shown
        caption = f"The arm {when}, under gravity as its base felt it when it was homed; bars by the model's masses."
        write_gravity_report(report, result, settings, arm=robot_picture(model, poses, caption, gravity=felt))
    if as_json:
        print_json({**settings, **result.as_data()})
        return
    print_table(title, *gravity_table(result))
    if result.gravity is not None:
        print(result.gravity)
    if report is not None:
        print(f"page: {report}")
