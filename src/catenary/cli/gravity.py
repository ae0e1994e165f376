"""catenary gravity, track and hold: torques under gravity, and simulated arms on bases that tilt and move."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import catenary
from catenary.cli.gravity_options import BASE_TILT, LEVEL_BASE, GivenGravity, SensingOptions
from catenary.cli.options import REPORT, Names, Numbers, Triple, argument, group, numbers, option, values_of
from catenary.cli.robot_options import (
    ROBOT,
    SIMULATED_SEED,
    DescriptionOptions,
    JointOptions,
    LoadedOptions,
    beyond_limits,
    one_or_each,
)
from catenary.cli.terminal import print_notes, print_result, prints_json
from catenary.control.controllers import CONTROLLERS, HOLDS, make_controller
from catenary.errors import ClosedLoopError, InputError
from catenary.tables import Column, Table
from catenary.units import TORQUE_UNIT

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.control.loop_report import Holding, Tracking
    from catenary.plant import Jointed
    from catenary.sensing.imu import SensedGravity
    from catenary.simulation.base_motion import MovingBase, Wave
    from catenary.workflows.gravity_trials import SimulatedArm

_SHOWN_POSES = 9  # of a motion, in its report
_NOTED_OFFSET = 0.5  # [deg|mm] of a reported position, from which a note says so
_SIMULATED = argument("ROBOT", "raven2 or raven2_right, simulated with their cables, or another, as rigid bodies.")
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_WAVE = "M/S2,HZ[,DEG]"


@group
class Conditions:
    """Options of a simulated arm: its base, its payload, its drives, its seed."""

    base_tilt_deg: tuple[float, float] | None = BASE_TILT
    rock: Sequence[str] = option(
        "AXIS,DEG,HZ[,DEG]", "Rock the base about its x, y or z axis, with a phase; repeatable, outermost first."
    )
    heave: Sequence[str] = option(_WAVE, "Accelerate the base up and down, with a phase; repeatable.")
    surge: Sequence[str] = option(_WAVE, "The same along the world's x axis.")
    sway: Sequence[str] = option(_WAVE, "The same along the world's y axis.")
    payload: float = option("KG", "Mass at the tool's wrist, unknown to the model.", 0.0, least=0.0)
    kp: Numbers | None = option("K,K,...", "Stiffness of PD in Nm/rad and N/m: one number, or one a joint.")
    kd: Numbers | None = option("K,K,...", "Damping of PD in Nms/rad and Ns/m, likewise.")
    friction: Numbers | None = option("F,F,...", "Coulomb friction in Nm and N; RAVENs use their cables'.")
    viscous: Numbers | None = option("F,F,...", "Viscous friction in Nms/rad and Ns/m, likewise.")
    simulated_imu: bool = option(None, "Measure gravity with a simulated IMU; implied by all sensor options.", False)
    sensor_bias: Triple | None = option("X,Y,Z", "Residual bias of the simulated accelerometer, in m/s2.")
    imu_frame: str | None = option("FRAME", "Frame of the robot with the simulated IMU. [default: its base]")
    seed: int | None = SIMULATED_SEED

    def as_data(self) -> dict[str, Any]:
        """Return plain data, for the JSON and the page."""
        given = {name: value for name, value in vars(self).items() if value not in (None, False, ())}
        return given | {"base_tilt_deg": self.base_tilt_deg or LEVEL_BASE, "payload": self.payload, "seed": self.seed}

    def base(self) -> "MovingBase":
        """Return the motion of the base that the arm stands on."""
        from catenary.simulation.base_motion import FixedBase, SwayingBase

        start = FixedBase(*map(math.radians, self.base_tilt_deg or LEVEL_BASE))
        rocks = tuple(_wave("--rock", text) for text in self.rock)
        along = ("--heave", self.heave, "z"), ("--surge", self.surge, "x"), ("--sway", self.sway, "y")
        moves = tuple(_wave(option, text, axis) for option, texts, axis in along for text in texts)
        return SwayingBase(rocks, moves, start) if rocks or moves else start

    def arm(self, robot: str, description: DescriptionOptions) -> "SimulatedArm":
        """Return the robot on its base."""
        from catenary.workflows.gravity_trials import simulated_arm

        drives = values_of(self, "kp", "kd", "friction", "viscous")
        return simulated_arm(
            robot, base=self.base(), payload=self.payload, seed=self.seed, massless=description.declared(),
            strict=description.strict, **{name: values and one_or_each(values) for name, values in drives.items()},
        )  # fmt: skip

    def gravity(self, arm: "SimulatedArm", sensing: SensingOptions) -> "SensedGravity | None":
        """Return a simulated unit on the base as a source of gravity; None where gravity is as it truly is."""
        asked = self.simulated_imu or self.sensor_bias is not None or self.imu_frame is not None
        if not asked and sensing == SensingOptions():
            return None
        from catenary.workflows.gravity_trials import base_sensor

        bias = self.sensor_bias or (0.0, 0.0, 0.0)
        sensor, mounting = base_sensor(
            self.base(), start=arm.plant.measured_js().time, bias=bias, noise=sensing.sensor_noise,
            seed=self.seed or 0, at=None if self.imu_frame is None else (arm.model, self.imu_frame),
        )  # fmt: skip
        return sensing.source(sensor.mailbox, mounting, angular=True, feed=sensor.advance)


def _wave(option: str, text: str, axis: str | None = None) -> "Wave":
    """Read amplitude, frequency and phase of a motion along an axis, or of a rocking motion (AXIS,DEG,HZ)."""
    from catenary.simulation.base_motion import Wave

    unit, rest = 1.0, text
    if axis is None:
        axis, _, rest = (part.strip() for part in text.partition(","))
        unit = math.radians(1.0)
        if axis not in _AXES:
            raise InputError(f'{option} "{text}": expected AXIS,DEG,HZ with axis x, y or z, as x,8,0.1')
    try:
        values = numbers(rest)
    except typer.BadParameter as error:
        raise InputError(f"{option}: {error.message}") from None
    if not all(map(math.isfinite, values)):
        raise InputError(f"{option}: expected finite numbers, got {', '.join(f'{v:g}' for v in values)}")
    if len(values) not in (2, 3) or values[1] < 0.0:
        raise InputError(
            f'{option} "{text}": expected an amplitude, a frequency of 0 Hz or more, and a phase in deg if any'
        )
    amplitude, frequency, phase = (*values, 0.0)[:3]
    return Wave(unit * amplitude, frequency, _AXES[axis], math.radians(phase))


def gravity(
    given: GivenGravity,
    loaded: LoadedOptions,
    joints: JointOptions,
    robot: str = ROBOT,
    latex: bool = option(None, "Print formulas for LaTeX, without --q.", False, not_with=("q", "q_deg", "as_json")),
    vendor: str | None = option("ur|kortex|franka", "Also print the vendor's command for it.", flag="--for"),
) -> None:
    """Print the torques that hold an arm still under gravity.

    On a tilted base, or under any gravity vector, next to those on a level base.

    Example: catenary gravity raven2 --q 0,1.57,0.32 --base-tilt-deg 0,20
    """
    import numpy as np

    from catenary.arrays import Floats
    from catenary.gravity.closed_robot import ClosedRobot
    from catenary.gravity.mass_plausibility import mass_doubts
    from catenary.gravity.torque import gravity_torque, unseen_torque
    from catenary.gravity.vendors import in_controller_base, vendor_command, vendor_of
    from catenary.spatial import LEVEL

    arm: catenary.RobotModel | ClosedRobot
    held: Callable[..., Floats]
    try:
        arm = model = loaded.load(robot)
        held = partial(gravity_torque, model)
    except ClosedLoopError as error:
        if latex or vendor is not None:
            raise InputError(f"--latex, --for: not for closed loops; {error}") from error
        arm = closed = loaded.load_closed(robot)
        model, held = closed.opened, closed.gravity_torque
    model.require_masses()
    gravity = given.gravity_of(model)
    if latex:
        from catenary.gravity.compact_regressor import gravity_latex

        print_notes([*given.doubts(gravity), *mass_doubts(model)])
        print(gravity_latex(model, gravity))
        return
    vendor_says = None
    if vendor is not None:
        command = vendor_command(vendor, in_controller_base(vendor, model, gravity))
        vendor_says = {"command": command, "limits": vendor_of(vendor).limits}
    values = joints.of(arm)
    torques, on_level = (held(values, vector).tolist() for vector in (gravity, LEVEL))
    units = [TORQUE_UNIT[unit] for unit in arm.joint_units]
    open_to = unseen_torque(model, values, gravity) if arm is model else np.zeros(arm.n)
    print_notes(
        [*beyond_limits(arm, values), *given.doubts(gravity), *mass_doubts(model), *_unseen(arm, model, open_to)]
    )
    found = {
        "robot": arm.name, "joints": arm.joint_names, "q": list(values), "gravity": gravity, "tau": torques,
        "unit": units, "level": on_level, "unseen": open_to.tolist(),
        "delta": held(values, gravity - LEVEL),  # for firmware that knows a level base only
        "base": model.base, **({} if vendor_says is None else {"vendor": vendor_says}),
    }  # fmt: skip
    shown = ", ".join(f"{v:.4g}" for v in gravity)
    axes = "base axes" if model.base == "base" else f"axes of {model.base}"
    columns: list[Column] = ["joint", ("torque", ":.4f"), ("level base", ":.4f"), ("difference", ":+.4f"), "unit"]
    apart = [here - there for here, there in zip(torques, on_level, strict=True)]
    rows = list(zip(arm.joint_names, torques, on_level, apart, units, strict=True))
    title = f"{arm.name}: what holds it still under gravity ({shown}) m/s2 in {axes}"
    command_line = None if vendor_says is None else f"{vendor}: {vendor_says['command'] or 'no command'}"
    print_result(found, Table(columns, rows, title), command_line)
    if vendor_says is not None and not prints_json():
        print_notes([f"{vendor}: {vendor_says['limits']}"])


def _unseen(arm: "Jointed", model: "catenary.RobotModel", open_to: "Floats") -> list[str]:
    sizes = [
        f"{name} by up to {size:.2g} {TORQUE_UNIT[unit]}"
        for name, unit, size in zip(arm.joint_names, arm.joint_units, open_to, strict=True)
        if size > 0.005
    ]
    if not sizes:
        return []
    hidden = ", ".join(unseen.name for unseen in model.unseen)
    return [
        f"{model.name} was identified on one base, which does not show {hidden}: under this gravity torques may be "
        f"off, {', '.join(sizes)}; recordings on a tilted base show it"
    ]


@group
class FollowedMotion:
    """Options of the motion that is followed."""

    motion: str = option("cartesian|random|poses", "Sinusoids of the tip, random, or rests of joint 1.", "cartesian")
    amplitude_mm: float = option("A", "Amplitude of the sinusoids.", 78.74, least=0.0)
    axes: Names = option("A,A,...", "Base axes that the sinusoids run along.", ("x", "y", "z"))
    seconds: float = option("S", "Length of the random motion.", 20.0, least=2.0)


def track(
    followed: FollowedMotion,
    conditions: Conditions,
    sensing: SensingOptions,
    description: DescriptionOptions,
    joints: JointOptions,
    robot: str = _SIMULATED,
    controller: str = option("NAME", f"{'; '.join(map(str, CONTROLLERS.values()))}.", "dg"),
    damping: str = option("relative|absolute", "Relative to the motion's, or as RAVEN-II does.", "relative"),
    report: Path | None = REPORT,
) -> None:
    """Compare controllers as a simulated arm follows a motion.

    Prints the joint errors and the PD term's share of the torque; with a sensor also how gravity was known.
    sg is PD with the gravity of a level base, dg PD with sensed gravity. --q is where a cartesian motion begins.

    Example: catenary track raven2 --controller sg --base-tilt-deg 0,20 --motion poses
    Example: catenary track raven2 --rock x,8,0.1 --rock y,4,0.14 --heave 2,0.12 --mounting-on ship --motion random
    """
    import numpy as np

    from catenary.workflows.gravity_trials import make_motion
    from catenary.workflows.gravity_trials import track as run

    own = [kind.name for kind in CONTROLLERS.values() if kind.accelerations]
    if controller in own and (conditions.kp or conditions.kd):
        raise InputError(f"--kp and --kd: {controller} has gains of accelerations; expected none but {', '.join(own)}")
    arm = conditions.arm(robot, description)
    law = make_controller(controller, arm, damping=damping)  # type: ignore[arg-type]  # refuses what it does not know
    chosen = make_motion(
        followed.motion, arm.model, arm.plant, np.random.default_rng(conditions.seed or 0),
        q_start=joints.given(arm.model), amplitude=followed.amplitude_mm / 1000.0,
        axes=followed.axes, seconds=followed.seconds,
    )  # fmt: skip
    source, felt = conditions.gravity(arm, sensing), arm.plant.measured_js().gravity
    result = run(arm, law, chosen.trajectory, windows=chosen.windows, gravity=source)
    settings = {"robot": robot, "controller": controller, "motion": followed.motion, "damping": damping}
    title = f"{robot} (simulated), controller {controller}, {followed.motion}"
    times = np.linspace(0.0, chosen.trajectory.duration, _SHOWN_POSES)
    poses = np.array([chosen.trajectory(time).q for time in times])
    shown = arm.model, poses, felt, "at the beginning of the motion, and at times along it"
    _conclude(title, result, settings | conditions.as_data() | sensing.as_data(), report, shown)


def hold(
    conditions: Conditions,
    sensing: SensingOptions,
    description: DescriptionOptions,
    joints: JointOptions,
    robot: str = _SIMULATED,
    controller: str = option("|".join(HOLDS), "Gravity of a level base, or sensed gravity.", "dg"),
    seconds: float = option("S", "How long to watch.", 10.0),
    calibrated: bool = option(None, "Use true joint positions instead of those that the robot reports.", False),
    report: Path | None = REPORT,
) -> None:
    """Test how far an arm drifts under gravity compensation.

    The arm is simulated; the command prints how far each joint drifts.

    Example: catenary hold raven2 --base-tilt-deg 0,180 --seconds 2
    """
    from catenary.workflows.gravity_trials import HOLD_START, start_pose
    from catenary.workflows.gravity_trials import hold_arm as run

    arm = conditions.arm(robot, description)
    law, pose = make_controller(controller, arm, among=HOLDS), joints.given(arm.model)
    if pose is None:
        pose = start_pose(arm.model, arm.plant, HOLD_START)
    felt = arm.plant.measured_js().gravity
    result = run(arm, law, pose, seconds, gravity=conditions.gravity(arm, sensing), calibrated=calibrated)
    joints_off = [
        joint for joint in result.as_data()["joints"] if not calibrated and joint["reported_off"] > _NOTED_OFFSET
    ]
    if joints_off:
        far = ", ".join(f"{joint['name']} by up to {joint['reported_off']:.2g} {joint['unit']}" for joint in joints_off)
        print_notes([
            f"gravity was computed where the robot reports its joints, and they were elsewhere, {far}: a joint drifts "
            "by what that costs, however well gravity is sensed; --calibrated knows where they are"
        ])  # fmt: skip
    settings = {"robot": robot, "controller": controller, "calibrated": calibrated}
    title = f"{robot} (simulated), held by {controller} for {seconds:g} s"
    shown = arm.model, result.q_true[[0, -1]], felt, "where it was put, and, paler, at the end"
    _conclude(title, result, settings | conditions.as_data() | sensing.as_data(), report, shown)


def _conclude(
    title: str,
    result: "Tracking | Holding",
    settings: Mapping[str, Any],
    report: Path | None,
    shown: "tuple[catenary.RobotModel, Floats, Floats, str]",
) -> None:
    from catenary.reports.gravity import gravity_table, write_gravity_report

    if report is not None:
        from catenary.reports.robot_plot import robot_picture

        model, poses, felt, when = shown
        caption = f"The arm {when}, under gravity as its base felt it when it was homed; bars by the model's masses."
        write_gravity_report(report, result, settings, arm=robot_picture(model, poses, caption, gravity=felt))
    gravity = None if result.gravity is None else str(result.gravity)
    page = None if report is None else f"page:  {report}"
    print_result({**settings, **result.as_data()}, gravity_table(result, title), gravity, page)
