"""catenary excitation, identify, identify-cable, payload: a motion that shows an arm's dynamics, and what it tells."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import partial
from math import degrees, hypot, isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

import catenary
from catenary.cli.gravity_options import GRAVITY, StatedGravity
from catenary.cli.options import (
    REPORT,
    REQUIRED,
    Names,
    Numbers,
    Six,
    Triple,
    argument,
    group,
    numbers,
    option,
    prints_tables,
    require_one,
    values_of,
)
from catenary.cli.out_files import EXCITATION, EXTERNAL, NAMED_AS_TYPED, PARAMETERS, TOOL, TRAJECTORY, URDF
from catenary.cli.recording_options import ACCEPT, ModelRecordingOptions, RecordingOptions
from catenary.cli.robot_options import LoadedOptions
from catenary.cli.terminal import print_notes, print_page, print_result, prints_json
from catenary.errors import InputError
from catenary.files import card_path
from catenary.robots.friction_terms import FRICTION_PARTS
from catenary.tables import Column, Table

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.identification.identify_options import IdentifyOptions
    from catenary.workflows.excitation import MotionSurroundings

Place = tuple[str, float, float, float]
_LOGS = argument("LOG", "Recordings: .parquet, or .npz with q, dq, tau and fs or t (SI); others with --map.")
_CONSISTENT = "--consistent/--free"
_FRICTION_HELP = f"Friction to try: {', '.join(FRICTION_PARTS)}; or none. [default: all]"
_CUT_OFF = option("F", "Cut-off of the filter. [default: the robot file's]")


@group
class IdentificationOptions:
    """Options of an identification, by the names of IdentifyOptions where it has them."""

    terms: str = option("full|static", "All dynamics, or poses at rest.", "full")
    cutoff_hz: float | None = _CUT_OFF
    weighting: str | None = option("none|range|spread|residual", "Weight of the axes. [default: the robot file's]")
    consistent: bool = option(None, "Only physically possible parameters; or any that fit.", True, flag=_CONSISTENT)
    friction: Names | None = option("PART,...", _FRICTION_HELP)
    prior: bool = option(None, "Pull masses towards those of the robot's file.", True, flag="--prior/--no-prior")
    rotors: Numbers | None = option("J,J,...", "Known rotor inertias at the joints, kg m2, kg. [default: identified]")
    no_rotors: bool = option(None, "No rotors but those of the robot's file.", False, not_with="rotors")
    base_sensor: Triple | None = option("X,Y,Z", "Accelerometer's place in the base, m. [default: its origin]")
    blocks: float | None = option("S", "Hold out every second block of S seconds (static: S rows).")

    def under(self, gravity: "Floats") -> "IdentifyOptions":
        """Return them for recordings under this gravity, (3,) in base axes [m/s2]."""
        from catenary.identification.identify_options import IdentifyOptions

        named = self.friction if self.friction != ("none",) else ()
        names = "terms", "cutoff_hz", "weighting", "consistent", "prior", "rotors", "blocks", "base_sensor"
        options = {name: value for name, value in values_of(self, *names).items() if value is not None}
        return IdentifyOptions(
            gravity=cast(Any, tuple(gravity.tolist())), find_rotors=not self.no_rotors,
            friction=FRICTION_PARTS if named is None else named, **options,
        )  # fmt: skip


@prints_tables
def identify(
    identification: IdentificationOptions,
    recordings: RecordingOptions,
    gravity: StatedGravity,
    data: Sequence[Path] = _LOGS,
    robot: str = option("ROBOT", "Catalogue name or file; needs no inertia.", REQUIRED),
    out: Path = option("FILE", f"Parameters to write, e.g. arm.npz. {NAMED_AS_TYPED}", REQUIRED, writes=PARAMETERS),
    test: Sequence[Path] = option("LOG", "Recording to test the result on; repeatable."),
    joints: Names = option("J,J,...", "Joints to identify; the arm holds its others still. [default: all]", ()),
    currents: bool = option(None, "Torques are motor currents: identify drive gains, with --load.", False),
    load: tuple[float, Path] | None = option("KG LOG", "Mass at the tip, recording with it.", goes_with="currents"),
    payload: tuple[float, str, float, float, float] | None = option(
        "KG FRAME X Y Z", "Its payload in all recordings, centre in a frame, in m. [default: as recordings show]"
    ),
    accept: Sequence[str] = ACCEPT,
    urdf: Path | None = option("FILE", "Also write the robot as URDF; not with --free.", writes=URDF),
    report: Path | None = REPORT,
) -> None:
    """Identify an arm's dynamics from recordings of it.

    Example: catenary identify psm_one.npz --robot dvrk_psm_motors --test another_day.npz --out psm.npz
    """
    from catenary.identification.identification import CarriedBody
    from catenary.identification.identification_file import save_identification
    from catenary.reports.identification import absolute_table, excitation_facts, mass_table, rotor_table
    from catenary.workflows.identify import identify_files

    options = identification.under(gravity.stated())
    if urdf is not None and not options.consistent:
        raise InputError("--urdf: only a physically consistent fit gives links an inertia; leave --free out")
    reading = replace(recordings.reading(), currents=currents)
    body = None if payload is None else CarriedBody(payload[1], payload[0], payload[2:])
    result = identify_files(
        data, robot, options, tests=test, reading=reading, load=load, payload=body, joints=joints, accept=accept
    )
    identified = result.identification
    save_identification(identified, result.card, out)
    if urdf is not None:
        from catenary.robots.urdf_export import write_urdf

        write_urdf(identified.robot(), urdf)
    content = {**result.summary(), "file": str(out), "card": str(card_path(out))}
    tables = identified.residual_table, absolute_table(identified), mass_table(identified), rotor_table(identified)
    lines = [f"{name}: {text}" for name, text in excitation_facts(identified)[:2]]
    print_result(content, *tables, *lines, f"parameters: {out}\ncard:  {card_path(out)}", notes=result.notes)
    if report is not None:  # last: whatever goes wrong with it, the parameters are there
        from catenary.reports.identification import write_identification_report

        shown = result.tests or result.training
        write_identification_report(report, identified, result.card, shown, notes=result.notes)
        print_page(report)


@prints_tables
def identify_cable(
    recordings: RecordingOptions,
    data: Path = argument("LOG", "Recording with positions, torques and, if available, joint encoders."),
    accept: Sequence[str] = ACCEPT,
) -> None:
    """Identify friction and stiffness of each joint's cable.

    From reversals, with 95 % intervals; best one joint at a time, at 100 Hz or more, with several speeds. Without an
    encoder at the joints, friction alone.

    Example: catenary identify-cable shoulder.parquet
    """
    from catenary.identification.cable_loops import CableLoop, cable_loops
    from catenary.recording.logs import read_recording
    from catenary.verdict.check import verdict
    from catenary.verdict.finding import judge

    def cell(loop: CableLoop, key: str) -> str | None:
        value, low, high = getattr(loop, key)
        return None if isnan(value) else f"{value:.3g} ({low:.3g} to {high:.3g})"

    log = read_recording(data, recordings.reading())
    notes = verdict([log], accept=accept, testing=True, done="identified").notes
    loops, doubts = cable_loops(log)
    notes += judge([(log.name, finding) for finding in doubts], accept, done="identified")
    columns: list[Column] = ["joint", "unit", ("following", "following:.3g")]
    for key in ("friction", "joint_side", "motor_side", "stiffness", "width"):
        columns.append((key.replace("_", " "), partial(cell, key=key)))
    table = Table(columns, loops, "Cables, in rad and Nm or m and N")
    lines = [f"{loop.joint}: not determined: {why}" for loop in loops for why in loop.untold]
    content = {"log": log.name, "joints": [loop._asdict() for loop in loops], "notes": notes}
    print_result(content, table, *lines, notes=notes)


@group
class WristSensor:
    """Options of a force/torque sensor at an arm's wrist."""

    wrist_sensor: str | None = option("ROBOT", "In place of --model: this arm's wrist sensor; LOG: a table of poses.")
    tool: Path | None = option(
        "FILE", "Also write the tool, for catenary tool-node.", writes=TOOL, goes_with="wrist_sensor"
    )
    sensor_frame: str | None = option("FRAME", "Frame of that sensor. [default: the tip]", goes_with="wrist_sensor")
    gravity: Triple | None = replace(GRAVITY, goes_with="wrist_sensor")


@prints_tables
def payload(
    wrist: WristSensor,
    recordings: ModelRecordingOptions,
    data: Sequence[Path] = _LOGS,
    model: Path | None = option("FILE", "Parameters that catenary identify wrote."),
    at: Place | None = option("FRAME X Y Z", "Place of the payload in a frame, in m. [default: anywhere]"),
    unloaded: Sequence[Path] = option("LOG", "Recording of the same day without payload; repeatable."),
    external: Path | None = option(
        "FILE",
        "Instead of a payload: write external joint torques per row, as .csv.",
        writes=EXTERNAL,
        not_with=("at", "wrist_sensor"),
    ),
    cutoff_hz: float | None = _CUT_OFF,
    accept: Sequence[str] = ACCEPT,
) -> None:
    """Estimate an arm's payload, a wrist's tool, or a push.

    The table of a wrist sensor has a row for each of six or more poses at rest: the joints by name in rad and m, fx,
    fy, fz in N and tx, ty, tz in Nm in the sensor's axes. It gives mass, centre of mass and the sensor's biases.

    Example: catenary payload loaded.npz --model psm.npz --at pitch 0.024 0.535 0
    Example: catenary payload poses.csv --wrist-sensor ur10e
    Example: catenary payload pushed.npz --model ur.npz --external pushed.csv
    """
    from catenary.workflows.identify import payload_of_files

    require_one(model=model, wrist_sensor=wrist.wrist_sensor)
    if model is None:
        _wrist_tool(data, wrist, accept)
        return
    reading = recordings.reading()
    how: dict[str, Any] = {"unloaded": unloaded, "cutoff_hz": cutoff_hz, "reading": reading, "accept": accept}
    if external is not None:
        _external(data, model, external, **how)
        return
    estimates, notes = payload_of_files(data, model, at=None if at is None else (at[0], at[1:]), **how)
    best, parts = estimates[0], list[Any]()
    if best.detected:
        sure = f" (probability {best.probability:.2f})" if len(best.likely) == 1 and at is None else ""
        parts.append(f"payload {best.location}{sure}")
    elif best.rival:
        parts.append("a payload, or something that looks alike: not determined")
    else:
        parts.append(f"no payload (confidence {best.confidence:.3f} that there is one)")
    if best.detected and len(best.likely) > 1:
        parts.append(f"if it is on {best.link}:")
    if best.beside and (best.detected or at is not None):
        parts.append(f"beside it: {best.beside}")
    has_load = best.detected or at is not None
    if best.mass is not None and has_load:
        parts.append(f"mass: {1000 * best.mass:.1f} g, standard deviation {1000 * (best.mass_std or 0.0):.1f} g")
    if best.moment is not None and best.moment_std is not None and has_load:
        moment, off = (", ".join(f"{v:.4f}" for v in values) for values in (best.moment, best.moment_std))
        parts.append(f"mass times place in {best.link}: {moment} kg m, standard deviations {off}")
    if len(estimates) > 1:
        likely: list[Column] = ["link", ("probability", "probability:.2f")]
        parts.append(Table(likely, estimates, "Links that could carry it"))
    content = asdict(best) | {"location": best.location, "candidates": [asdict(other) for other in estimates[1:]]}
    print_result(content | {"notes": notes}, *parts, notes=notes)


def _external(data: Sequence[Path], model: Path, out: Path, **how: Any) -> None:
    from catenary.workflows.identify import external_torques_of_file

    if len(data) != 1:
        raise InputError(f"--external: expected one recording, got {len(data)}")
    loads = external_torques_of_file(data[0], model, **how)
    loads.write(out)
    columns: list[Column] = ["joint", ("largest", "largest:.3g"), ("at [s]", "time:.2f")]
    columns += [("95 % within", "half_width:.3g"), "unit", ("beyond", "beyond:.1f %")]
    title = f"External torques in {loads.log}; 5 % lie beyond where nothing touches"
    lines = []
    if (strongest := loads.strongest()) is not None:
        numbers = [f"{v:.2f} ± {w:.2f}" for v, w in zip(strongest["wrench"], strongest["half_width"], strict=True)]
        lines += [
            f"largest force on {loads.model.tip}: {', '.join(numbers[:3])} N in base axes at {strongest['time']:.2f} s",
            f"moment then: {', '.join(numbers[3:])} Nm",
        ]
    content = {**loads.summary(), "file": str(out)}
    print_result(content, Table(columns, loads.joints, title), *lines, f"rows: {out}", notes=loads.notes)


def _wrist_tool(data: Sequence[Path], wrist: WristSensor, accept: Sequence[str]) -> None:
    from catenary.sensing.wrist_tool import save_tool
    from catenary.spatial import rotation_vector
    from catenary.workflows.identify import wrist_tool_of_file

    if len(data) != 1:
        raise InputError(f"--wrist-sensor: expected one table of poses, got {len(data)} files")
    arm, gravity = catenary.load_robot(wrist.wrist_sensor or ""), StatedGravity(wrist.gravity).stated()
    tool, notes = wrist_tool_of_file(data[0], arm, wrist.sensor_frame, gravity, accept)
    tool = replace(tool, robot=wrist.wrist_sensor or "", frame=wrist.sensor_frame or arm.tip)
    if wrist.tool is not None:
        save_tool(wrist.tool, tool)
    facts = [("mass", f"{tool.mass:.4f} kg, standard deviation {tool.mass_deviation:.4f} kg")]
    rows = (
        ("centre", tool.center, tool.center_deviation, "m in the sensor's axes"),
        ("force bias", tool.force_bias, tool.force_bias_deviation, "N"),
        ("torque bias", tool.torque_bias, tool.torque_bias_deviation, "Nm"),
    )
    for name, values, deviations, unit in rows:
        shown, off = (", ".join(f"{v:.4f}" for v in row) for row in (values, deviations))
        facts.append((name, f"{shown} {unit}, standard deviations {off}"))
    residual = ("left", f"{tool.force_rms:.4f} N, {tool.torque_rms:.4f} Nm RMS")
    counted = "what holds the tool" if tool.sign < 0.0 else "the load"
    turned = degrees(hypot(*rotation_vector(tool.rotation)))
    axes = ("sensor", f"counts {counted}, in axes turned by {turned:.1f} deg from {tool.frame}")
    print_result(asdict(tool) | {"notes": notes}, [*facts, residual, axes], notes=notes)


Touching = tuple[str, str]
Placed = tuple[Path, Numbers]
_UNCHECKED = "no_collision_check"


def _placed_mesh(text: str) -> tuple[Path, Numbers]:
    name, _, place = text.rpartition("@")
    return (Path(name), numbers(place, 3)) if name else (Path(text), (0.0, 0.0, 0.0))


def _pair(text: str) -> tuple[str, str]:
    first, _, second = text.partition(":")
    if not first or not second:
        raise typer.BadParameter(f"expected two names, such as upper_arm_link:floor, got {text!r}")
    return first, second


@group
class CollisionOptions:
    """What stands about the robot, and what its own links look like."""

    floor_m: float | None = option("Z", "Height of the floor in the base frame, z up.", not_with=_UNCHECKED)
    box: Sequence[Six] = option("X,Y,Z,DX,DY,DZ", "A box's centre and edges, m; repeatable.", not_with=_UNCHECKED)
    mesh: Sequence[Placed] = option("FILE[@X,Y,Z]", "A mesh in m; repeatable.", read=_placed_mesh, not_with=_UNCHECKED)
    margin_mm: float = option("MM", "Smallest distance between bodies.", 10.0)
    link_radius_mm: float | None = option("MM", "Take capsules of this radius along the links as their shapes.")
    package_dir: Sequence[Path] = option("FOLDER", "ROS package with meshes; repeatable. [default: above the URDF]")
    may_touch: Sequence[Touching] = option("A:B", "Pair of links or obstacles to ignore; repeatable.", read=_pair)
    no_collision_check: bool = option(None, "Design without a collision check.", False)

    def around(self, robot: str, model: "catenary.RobotModel") -> "MotionSurroundings":
        """Return the obstacles around a robot."""
        from catenary.collision.scene import box_at, floor_at, mesh_at
        from catenary.robots.shapes import load_geometry
        from catenary.workflows.excitation import MotionSurroundings

        if not 0.0 < self.margin_mm <= 1000.0:
            raise InputError(f"--margin-mm: expected above 0 and at most 1000 mm, got {self.margin_mm:g}")
        if self.no_collision_check:
            return MotionSurroundings(None, unchecked="as --no-collision-check says")
        obstacles = [] if self.floor_m is None else [floor_at(self.floor_m)]
        obstacles += [box_at(k, place) for k, place in enumerate(self.box, start=1)]
        obstacles += [mesh_at(name, place) for name, place in self.mesh]
        radius = None if self.link_radius_mm is None else 1e-3 * self.link_radius_mm
        return MotionSurroundings(
            load_geometry(robot, model, packages=self.package_dir, link_radius=radius),
            tuple(obstacles),
            1e-3 * self.margin_mm,
            tuple(self.may_touch),
            f"{model.name} has no shapes, and no masses to estimate link radii from: give --link-radius-mm MM",
        )


@group
class LimitOptions:
    """Limits to keep, narrower than the robot's own or in their place where it has none."""

    lower: Numbers | None = option("Q,Q,...", "Lower limits to keep, rad and m.")
    upper: Numbers | None = option("Q,Q,...", "Upper limits to keep, rad and m.")
    velocity: Numbers | None = option("V,V,...", "Limits of velocity to keep, rad/s and m/s.")
    acceleration: Numbers | None = option("A,A,...", "Limits of acceleration to keep, rad/s2 and m/s2. [default: none]")
    effort: Numbers | None = option("T,T,...", "Limits of torque to keep, Nm and N. [default: the robot's]")


@group
class DesignOptions:
    """Options of the motion or the poses that are designed."""

    static: int | None = option("N", "N poses to hold, in place of one period of a Fourier motion.", min=1)
    period: float = option("S", "Period of the motion.", 10.0, flag="--period-s")
    harmonics: int = option("N", "Harmonics of the motion, 3 or more.", 5)
    rate: float = option("F", "Rows of the motion per second.", 200.0, flag="--rate-hz")
    trials: int = option("N", "Motions to choose from; more trials find a better one.", 300, min=1)


def excitation(
    motion: DesignOptions,
    loaded: LoadedOptions,
    gravity: StatedGravity,
    limits: LimitOptions,
    collisions: CollisionOptions,
    robot: str = argument("ROBOT", "Catalogue name or file; needs no inertia."),
    out: Path = option(
        "FILE", f"File to write t, q, dq, ddq to, .npz or .csv. {NAMED_AS_TYPED}", REQUIRED, writes=EXCITATION
    ),
    trajectory: Path | None = option(
        "FILE", "Also write a ROS JointTrajectory, .json or .yaml.", writes=TRAJECTORY, not_with="static"
    ),
    ros: int = option("1|2", "ROS that --trajectory is for.", 2, goes_with="trajectory"),
    seed: int = option("N", "Seed of everything random.", 0, min=0),
) -> None:
    """Design a motion to identify an arm; moves nothing.

    It keeps the arm's limits and avoids collisions; --static designs poses to hold.

    Example: catenary excitation panda --floor-m 0 --out motion.csv
    """
    import numpy as np

    from catenary.identification.excitation import motion_room
    from catenary.workflows.excitation import design_excitation, write_motion, write_trajectory

    model = loaded.load(robot)
    stated = {name: values for name, values in vars(limits).items() if values is not None}
    if motion.static is not None:  # poses are held: how fast they are reached is the robot's
        stated.setdefault("velocity", (1.0,) * model.n)
    room = motion_room(model, **stated)
    around = collisions.around(robot, model)
    result = design_excitation(
        model, room, around, np.random.default_rng(seed), gravity=gravity.stated(), **vars(motion)
    )
    design = result.design
    write_motion(out, model, design.time, design.q, design.qd, design.qdd)
    if trajectory is not None:
        write_trajectory(design, model.joint_names, trajectory, ros=ros)
    print_notes([note for note in result.notes if not prints_json() or note.startswith("warning: ")])
    files = {"file": str(out), **({} if trajectory is None else {"trajectory": str(trajectory)})}
    what = "poses" if design.terms == "static" else f"rows, {design.time[-1]:g} s"
    parts: list[Any] = [
        f"{model.name}: {len(design.q)} {what}",
        f"condition: {design.condition:.4g} for {design.base.count} base parameters",
        *result.kept(),
    ]
    lines = [f"{name}: {path}" for name, path in files.items()]
    print_result({**result.summary(), "seed": seed, **files}, *parts, *lines)
