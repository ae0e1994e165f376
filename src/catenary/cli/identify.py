"""catenary identify, identify-cable, payload: an arm's dynamics from recordings of it, and what it carries."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import typer

from catenary.cli.gravity_options import GRAVITY, IMU_READING, gravity_of_reading
from catenary.cli.options import AS_JSON, REPORT, REQUIRED, Names, Numbers, Triple, argument, option, require_one
from catenary.cli.out_files import EXTERNAL, NAMED_AS_TYPED, PARAMETERS, URDF
from catenary.cli.recording_options import ACCEPT, ModelRecordingOptions, RecordingOptions
from catenary.cli.terminal import print_page, print_result
from catenary.errors import InputError
from catenary.files import card_path

if TYPE_CHECKING:
    from catenary.recording.logs import Reading

Place = tuple[str, float, float, float]
LOGS = argument("LOG", "Recordings: .parquet, or .npz with q, dq, tau and fs or t (SI); others with --map.")
IN_PLACE_OF_GRAVITY = replace(IMU_READING, not_with="gravity")
_CONSISTENT = "--consistent/--free"
CUT_OFF = option("F", "Cut-off of the filter. [default: the robot file's]")


def gravity_vector(vector: Triple | None, reading: Triple | None) -> Triple:
    """Return the gravity that --gravity or --imu-reading gives, level when neither does."""
    from catenary.identification.identify_options import NOMINAL_GRAVITY

    if reading is not None:
        x, y, z = gravity_of_reading(reading).tolist()
        return x, y, z
    return vector or NOMINAL_GRAVITY


def _rows(text: str) -> tuple[int, int]:
    first, _, last = text.partition(":")
    try:
        return int(first), int(last)
    except ValueError:
        raise typer.BadParameter(f"expected FIRST:LAST, such as 921:6791, got {text!r}") from None


def identify(
    recordings: RecordingOptions,
    data: Sequence[Path] = LOGS,
    robot: str = option("ROBOT", "Catalogue name or file; needs no inertia.", REQUIRED),
    out: Path = option("FILE", f"Parameters to write, e.g. arm.npz. {NAMED_AS_TYPED}", REQUIRED, writes=PARAMETERS),
    test: Sequence[Path] = option("LOG", "A recording to judge the result by; may be repeated."),
    terms: str = option("full|static", "All dynamics, or poses at rest.", "full"),
    cutoff_hz: float | None = CUT_OFF,
    period: int | None = option("N", "Samples of the motion's period. [default: the robot file's]", least=1),
    weighting: str | None = option("none|range|spread|residual", "Weight of the axes. [default: the robot file's]"),
    consistent: bool = option(None, "Only physically possible parameters; or any that fit.", True, flag=_CONSISTENT),
    friction: Names | None = option(
        "PART,...", "Friction to try: asymmetric, stribeck, load, presliding, recording; or none. [default: all]"
    ),
    prior: bool = option(None, "Pull masses towards those of the robot's file.", True, flag="--prior/--no-prior"),
    rotors: Numbers | None = option("J,J,...", "Known rotor inertias at the joints, kg m2, kg. [default: identified]"),
    no_rotors: bool = option(None, "No rotors but those of the robot's file.", False, not_with="rotors"),
    blocks: float | None = option("S", "Hold out every second block of S seconds (static: S rows)."),
    joints: Names = option("J,J,...", "Joints to identify, of a longer arm that holds the others. [default: all]", ()),
    currents: bool = option(None, "Torques are motor currents: find the drives' gains, by --load.", False),
    load: tuple[float, Path] | None = option("KG LOG", "Mass at the tip, recording with it.", goes_with="currents"),
    rows: tuple[int, int] | None = option("A:B", "Rows of LOG to fit. [default: all]", read=_rows),
    gravity: Triple | None = GRAVITY,
    imu_reading: Triple | None = IN_PLACE_OF_GRAVITY,
    accept: Sequence[str] = ACCEPT,
    urdf: Path | None = option("FILE", "Also write the robot as URDF; not with --free.", writes=URDF),
    report: Path | None = REPORT,
    as_json: bool = AS_JSON,
) -> None:
    """Identify an arm's dynamics from recordings of it.

    Example: catenary identify psm_one.npz --robot dvrk_psm_motors --test another_day.npz --out psm.npz
    """
    from catenary.identification.identification_file import save_identification
    from catenary.identification.identify_options import FRICTION_PARTS, IdentifyOptions
    from catenary.reports.identification import (
        absolute_table,
        excitation_facts,
        mass_table,
        residual_table,
        rotor_table,
    )
    from catenary.workflows.identify import identify_files

    parts = FRICTION_PARTS if friction is None else () if friction == ("none",) else friction
    options = IdentifyOptions(
        terms=cast(Any, terms), gravity=gravity_vector(gravity, imu_reading), cutoff_hz=cutoff_hz,
        period_samples=period, weighting=cast(Any, weighting), consistent=consistent, friction=parts, prior=prior,
        find_rotors=not no_rotors, rotors=rotors, blocks=blocks,
    )  # fmt: skip
    if urdf is not None and not consistent:
        raise InputError("--urdf: only a physically consistent fit gives links an inertia; leave --free out")
    reading = replace(recordings.reading(), currents=currents)
    result = identify_files(
        data, robot, options, tests=test, rows=rows, reading=reading, load=load, joints=joints, accept=accept
    )
    found = result.identification
    save_identification(found, result.card, out)
    if urdf is not None:
        from catenary.robots.urdf_export import write_urdf

        write_urdf(found.robot(), urdf)
    content = {**result.summary(), "file": str(out), "card": str(card_path(out))}
    tables = residual_table(found), absolute_table(found), mass_table(found), rotor_table(found)
    lines = [f"{name}: {text}" for name, text in excitation_facts(found)[:2]]
    print_result(as_json, content, *tables, *lines, f"parameters: {out}\ncard:  {card_path(out)}", notes=result.notes)
    if report is not None:  # last: whatever goes wrong with it, the parameters are there
        from catenary.reports.identification import write_identification_report

        shown = result.tests or result.training
        write_identification_report(report, found, result.card, shown, notes=result.notes)
        print_page(report, as_json)


def identify_cable(
    recordings: RecordingOptions,
    data: Path = argument(
        "LOG", "Recording with positions, torques and, where there is one, an encoder at the joints."
    ),
    accept: Sequence[str] = ACCEPT,
    as_json: bool = AS_JSON,
) -> None:
    """Find friction and stiffness of each joint's cable.

    From reversals, with 95 % intervals; best one joint at a time, at 100 Hz or more, with several speeds. Without an
    encoder at the joints, friction alone.

    Example: catenary identify-cable shoulder.parquet
    """
    from catenary.identification.cable_loops import CableLoop, cable_loops
    from catenary.recording.logs import read_recording
    from catenary.reports.page import Table, TableColumn
    from catenary.verdict.check import verdict
    from catenary.verdict.finding import judge

    def cell(loop: CableLoop, key: str) -> str | None:
        value, low, high = getattr(loop, key)
        return None if isnan(value) else f"{value:.3g} ({low:.3g} to {high:.3g})"

    log = read_recording(data, recordings.reading())
    notes = verdict([log], accept=accept, testing=True, done="identified").notes
    loops, doubts = cable_loops(log)
    notes += judge([(log.name, each) for each in doubts], accept, done="identified")
    columns = [TableColumn(key, key, ".3g") for key in ("joint", "unit", "following")]
    for key in ("friction", "joint_side", "motor_side", "stiffness", "width"):
        columns.append(TableColumn(key.replace("_", " "), partial(cell, key=key)))
    table = Table(columns, loops, "Cables, in rad and Nm or m and N")
    lines = [f"{loop.joint}: not told: {why}" for loop in loops for why in loop.untold]
    content = {"log": log.name, "joints": [loop._asdict() for loop in loops], "notes": notes}
    print_result(as_json, content, table, *lines, notes=notes)


def payload(
    recordings: ModelRecordingOptions,
    data: Sequence[Path] = LOGS,
    model: Path | None = option("FILE", "Parameters that catenary identify wrote."),
    wrist_sensor: str | None = option("ROBOT", "In place of --model: this arm's wrist sensor; LOG: a table of poses."),
    sensor_frame: str | None = option("FRAME", "Frame of that sensor. [default: the tip]", goes_with="wrist_sensor"),
    gravity: Triple | None = replace(GRAVITY, goes_with="wrist_sensor"),
    at: Place | None = option("FRAME X Y Z", "Place of the payload in a frame, in m. [default: anywhere]"),
    unloaded: Sequence[Path] = option("LOG", "A recording of the same day without payload; may be repeated."),
    external: Path | None = option(
        "FILE",
        "In place of a payload: write the external joint torques, row by row, as .csv.",
        writes=EXTERNAL,
        not_with=("at", "wrist_sensor"),
    ),
    cutoff_hz: float | None = CUT_OFF,
    accept: Sequence[str] = ACCEPT,
    as_json: bool = AS_JSON,
) -> None:
    """Estimate an arm's payload, a wrist's tool, or a push.

    The table of a wrist sensor has a row for each of four poses at rest or more: the joints by name in rad and m, fx,
    fy, fz in N and tx, ty, tz in Nm in the sensor's axes. Mass, centre of mass and the sensor's biases come out.

    Example: catenary payload loaded.npz --model psm.npz --at pitch 0.024 0.535 0
    Example: catenary payload poses.csv --wrist-sensor ur10e
    Example: catenary payload pushed.npz --model ur.npz --external pushed.csv
    """
    from catenary.workflows.identify import payload_of_files

    require_one(model=model, wrist_sensor=wrist_sensor)
    if model is None:
        _wrist_tool(data, wrist_sensor or "", sensor_frame, gravity_vector(gravity, None), as_json)
        return
    if external is not None:
        _external(data, model, unloaded, cutoff_hz, recordings.reading(), accept, external, as_json)
        return
    place = None if at is None else (at[0], at[1:])
    result = payload_of_files(
        data, model, at=place, unloaded=unloaded, cutoff_hz=cutoff_hz, reading=recordings.reading(), accept=accept
    )
    best, parts = result.payload, list[Any]()
    if best.detected:
        sure = f" (probability {best.probability:.2f})" if len(best.likely) == 1 and at is None else ""
        parts.append(f"payload {best.location}{sure}")
    elif best.like_zeros:
        parts.append("a payload, or zeros of torque that shifted: not told")
    else:
        parts.append(f"no payload (confidence {best.confidence:.3f} that there is one)")
    if best.detected and len(best.likely) > 1:
        parts.append(f"if it is on {best.link}:")
    told = best.detected or at is not None
    if best.mass is not None and told:
        parts.append(f"mass: {1000 * best.mass:.1f} g, standard deviation {1000 * (best.mass_std or 0.0):.1f} g")
    if best.moment is not None and best.moment_std is not None and told:
        moment, off = (", ".join(f"{v:.4f}" for v in each) for each in (best.moment, best.moment_std))
        parts.append(f"mass times place in {best.link}: {moment} kg m, standard deviations {off}")
    if result.candidates:
        from catenary.reports.page import Table, TableColumn

        columns = [
            TableColumn("link", "link"),
            TableColumn("probability", "probability", ".2f"),
            TableColumn("explained", lambda candidate: 100.0 * candidate.explained, ".1f", " %"),
        ]
        title = "Links that could carry it, and what it would explain of the residual there"
        parts.append(Table(columns, [best, *result.candidates], title))
    print_result(as_json, result.summary(), *parts, notes=result.notes)


def _external(
    data: Sequence[Path],
    model: Path,
    unloaded: Sequence[Path],
    cutoff_hz: float | None,
    reading: "Reading",
    accept: Sequence[str],
    out: Path,
    as_json: bool,
) -> None:
    from catenary.reports.page import Table, TableColumn
    from catenary.workflows.identify import external_torques_of_file

    if len(data) != 1:
        raise InputError(f"--external: expected one recording, got {len(data)}")
    found = external_torques_of_file(
        data[0], model, unloaded=unloaded, cutoff_hz=cutoff_hz, reading=reading, accept=accept
    )
    found.write(out)
    columns = [
        TableColumn("joint", "joint"),
        TableColumn("largest", "largest", ".3g"),
        TableColumn("at [s]", "time", ".2f"),
        TableColumn("95 % within", "half_width", ".3g"),
        TableColumn("unit", "unit"),
        TableColumn("beyond", lambda joint: 100.0 * joint.beyond, ".1f", " %"),
    ]
    title = f"External torques in {found.log}; 5 % lie beyond where nothing touches"
    lines = []
    if (strongest := found.strongest()) is not None:
        told = [f"{v:.2f} ± {w:.2f}" for v, w in zip(strongest["wrench"], strongest["half_width"], strict=True)]
        lines += [
            f"largest force on {found.model.tip}: {', '.join(told[:3])} N in base axes at {strongest['time']:.2f} s",
            f"moment then: {', '.join(told[3:])} Nm",
        ]
    content = {**found.summary(), "file": str(out)}
    print_result(as_json, content, Table(columns, found.joints, title), *lines, f"rows: {out}", notes=found.notes)


def _wrist_tool(data: Sequence[Path], robot: str, frame: str | None, gravity: Triple, as_json: bool) -> None:
    from catenary.robots.catalog import load_robot
    from catenary.workflows.wrist_tool import wrist_tool_of_file

    if len(data) != 1:
        raise InputError(f"--wrist-sensor: expected one table of poses, got {len(data)} files")
    tool, notes = wrist_tool_of_file(data[0], load_robot(robot), frame, gravity)
    facts = [("mass", f"{tool.mass:.4f} kg, standard deviation {tool.mass_deviation:.4f} kg")]
    told = (
        ("centre", tool.center, tool.center_deviation, "m in the sensor's axes"),
        ("force bias", tool.force_bias, tool.force_bias_deviation, "N"),
        ("torque bias", tool.torque_bias, tool.torque_bias_deviation, "Nm"),
    )
    for name, values, deviations, unit in told:
        shown, off = (", ".join(f"{v:.4f}" for v in row) for row in (values, deviations))
        facts.append((name, f"{shown} {unit}, standard deviations {off}"))
    left = ("left", f"{tool.force_rms:.4f} N, {tool.torque_rms:.4f} Nm RMS")
    print_result(as_json, tool._asdict() | {"notes": notes}, [*facts, left], notes=notes)
