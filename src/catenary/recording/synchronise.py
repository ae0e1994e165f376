"""Topics with clocks of their own onto the stamps of raven_state: a MotionLog to calibrate with, and a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import FileFormatError, InputError
from catenary.plant import UNUSED, MotionLog
from catenary.recording.clock_steps import ClockStep
from catenary.recording.extract import TopicFile, topic_file
from catenary.recording.raven_transmission import COUPLING, RATIO
from catenary.recording.series import Series, TopicReport, clean_series, interpolate
from catenary.recording.topics import (
    AXES,
    EXT_JPOS,
    RAVENSTATE,
    RAVENSTATE_100HZ,
    SECOND,
    Arm,
    Topic,
    measured_topic,
)
from catenary.transmission.cable_coupling import joint_forces

CALIBRATED = ("shoulder", "elbow", "insertion")
UNITS = ("rad", "rad", "m")
OTHERS = ("roll", "wrist", "jaw1", "jaw2")
ROBOT: Mapping[Arm, str] = {"gold": "raven2", "green": "raven2_right"}
# cable torque or tension = torque at the gearbox's output * ratio / gearbox [raven2 source: transmission ratios; RE40
# with 49/4, RE30 with 26/7]; the joints' torques follow through the cables' coupling, as a controller is told them
JOINT_TORQUE: Mapping[str, float] = {
    **{joint: ratio / 12.25 for joint, ratio in RATIO.items()},  # [1], [1], [1/m]
    "roll": 5.395176 * 7 / 26, "wrist": 8.991960 * 7 / 26, "jaw1": 8.991960 * 7 / 26, "jaw2": 8.991960 * 7 / 26,
}  # fmt: skip


@dataclass(frozen=True)
class SynchroniseOptions:
    """Arm, columns, and the limit on gaps between samples."""

    arm: Arm = "gold"
    max_gap: float = 0.05  # [s] between two samples that are interpolated between
    # further columns of raven_state for the log to carry, such as ("mpos", "encVals"), or ("all",)
    columns: Sequence[str] = ()


@dataclass(frozen=True)
class Synchronisation:
    """A motion log, with reports on the topics that it was made from."""

    log: MotionLog
    topics: tuple[TopicReport, ...]
    without_encoder: int  # rows whose `ok` is not set
    dropped: int  # rows left out since the robot's own numbers were not finite


def synchronise(folder: Path, options: SynchroniseOptions | None = None) -> Synchronisation:
    """Bring an extraction's encoders and measured_js onto the stamps of raven_state.

    A row is a raven_state message. `q_nominal` and `qd` are its jpos and jvel, `tau` its commanded torque at the
    joint, `q_encoder` ext_jpos between its two neighbours in time. `ok` is cleared where these lie further apart
    than `max_gap`, before the first and after the last.
    Signals are q:<joint> and tau:<joint> of roll, wrist, jaws and the unused channel, and the further columns that
    `options` asks for: an arm's own as mpos:<axis>, pos:x, ori:11, type, the other arm's as green_mpos:<axis>, those
    of neither as runlevel. measured_js, which repeats jpos, is only reported on. Messages with a stamp that was there
    before are dropped, messages out of order are sorted; both are counted.

    Args:
        folder: What `extract` wrote.
        options: Arm and limits.
    """
    options = options if options is not None else SynchroniseOptions()
    if not options.max_gap > 0.0:
        raise InputError(f"synchronise: expected a positive gap, got {options.max_gap}")
    arm = options.arm
    state_names = list(dict.fromkeys([*needed_columns(arm), *state_columns(options.columns)]))
    file = open_state(folder)
    about = file.about
    state = read_series(file, state_names, options.max_gap)
    span = (int(state.stamp[0]), int(state.stamp[-1]))
    clock = state.report.clock_steps
    encoder = read_first_column(folder, EXT_JPOS, options.max_gap, span, clock)
    reports = [state.report, encoder.report]
    if (folder / f"{measured_topic(arm).stem}.parquet").is_file():
        reports.append(read_first_column(folder, measured_topic(arm), options.max_gap, span, clock).report)
    return build_log(
        name=folder.name,
        robot=about.robot if about.robot is not None else ROBOT[arm],
        simulated=about.simulated,
        state=dict(zip(state_names, state.values.T, strict=True)),
        state_stamp=state.stamp,
        encoder=encoder,
        options=options,
        reports=tuple(reports),
    )


def build_log(
    *,
    name: str,
    robot: str | None,
    simulated: bool,
    state: Mapping[str, NDArray[Any]],
    state_stamp: NDArray[np.int64],
    encoder: Series,
    options: SynchroniseOptions,
    reports: tuple[TopicReport, ...] = (),
    force: Floats | None = None,
) -> Synchronisation:
    """Build the log of an arm from cleaned series.

    Args:
        name: Of the log.
        robot: Of the log.
        simulated: Of the log.
        state: `jpos:`, `tau:` and `jvel:` of the arm's axes, each (N,), SI, tau at the gearbox's output; further
            columns by their names in extracted files.
        state_stamp: (N,) [ns] ascending.
        encoder: Positions of the joints to calibrate.
        options: Arm and limits.
        reports: On the topics.
        force: (N, 3) [N] that the recording has besides; becomes the signals force_x, force_y and force_z.
    """
    arm = options.arm
    needed = needed_columns(arm)
    whole = np.logical_and.reduce([np.isfinite(state[key]) for key in needed])
    stamp = state_stamp[whole]
    if len(stamp) == 0:
        raise InputError(f'recording "{name}": no state message with finite numbers is left')
    further, further_units = further_signals(state, options.columns, arm, whole)
    state = {key: state[key][whole].astype(np.float64) for key in needed}
    q_nominal = np.column_stack([state[f"jpos:{arm}_{joint}"] for joint in CALIBRATED])
    q_encoder, ok = interpolate(encoder, stamp, options.max_gap)
    ok &= np.isfinite(q_encoder).all(axis=1)
    signals = {f"q:{joint}": state[f"jpos:{arm}_{joint}"] for joint in OTHERS}
    signals |= {f"tau:{joint}": state[f"tau:{arm}_{joint}"] * JOINT_TORQUE[joint] for joint in OTHERS}
    # as published, of no unit that means anything
    signals |= {f"q:{UNUSED}": state[f"jpos:{arm}_{UNUSED}"], f"tau:{UNUSED}": state[f"tau:{arm}_{UNUSED}"]}
    signals |= further
    units = (
        further_units | {f"q:{joint}": "rad" for joint in OTHERS} | {f"tau:{joint}": "Nm" for joint in OTHERS}
    )
    shoulder, elbow, insertion = (state[f"tau:{arm}_{joint}"] * JOINT_TORQUE[joint] for joint in CALIBRATED)
    if force is not None:
        signals |= {f"force_{axis}": column[whole] for axis, column in zip("xyz", force.T, strict=True)}
        units |= dict.fromkeys(("force_x", "force_y", "force_z"), "N")
    notes = [note for report in reports for note in report.notes()]
    if not whole.all():
        notes.append(f"{int((~whole).sum())} state messages with numbers that are not finite were left out")
    log = MotionLog(
        name=name,
        joint_names=CALIBRATED,
        joint_units=UNITS,
        q_nominal=q_nominal,
        q_encoder=q_encoder,
        ok=ok,
        time=(stamp - stamp[0]) / SECOND,
        began=int(stamp[0]) / SECOND,
        qd=np.column_stack([state[f"jvel:{arm}_{joint}"] for joint in CALIBRATED]),
        tau=np.column_stack(joint_forces(COUPLING, (shoulder, elbow, insertion))),
        signals=signals,
        signal_units=units,
        robot=robot,
        simulated=simulated,
        notes=tuple(notes),
    )
    return Synchronisation(log, reports, int((~ok).sum()), int((~whole).sum()))


def needed_columns(arm: Arm) -> list[str]:
    """Return the columns of raven_state that a log is made of."""
    return [f"{kind}:{arm}_{axis}" for kind in ("jpos", "tau", "jvel") for axis in AXES]


def state_columns(columns: Sequence[str]) -> list[str]:
    """Return the names of the numbers in columns of raven_state, of both arms; ("all",) means every one."""
    known = {column.name: column.names for column in RAVENSTATE.columns}
    unknown = [name for name in columns if name not in known and name != "all"]
    if unknown:
        raise InputError(f"columns: no {', '.join(unknown)} in raven_state; it has all, {', '.join(known)}")
    wanted = known if "all" in columns else dict.fromkeys(columns)
    return [name for column in wanted for name in known[column]]


def further_signals(
    state: Mapping[str, NDArray[Any]], columns: Sequence[str], arm: Arm, whole: NDArray[np.bool_]
) -> tuple[dict[str, Floats], dict[str, str]]:
    """Return the columns asked for as signals, by name and unit; what is in every log is not repeated.

    Args:
        state: Numbers of raven_state by their names in extracted files, each (N,), SI; others are left out.
        columns: Asked for, see `SynchroniseOptions`.
        arm: Whose log it is.
        whole: (N,) rows of the log.
    """
    unit = {
        name: u for column in RAVENSTATE.columns for name, u in zip(column.names, column.units, strict=True)
    }
    signals, units = {}, {}
    for name in state_columns(columns):
        kind, _, label = name.partition(":")
        if name not in state or (kind in ("jpos", "tau") and label.startswith(arm)):
            continue
        # another arm's name stands first: its tau is none of the group tau
        whose, _, rest = label.partition("_")
        first = "" if whose in ("", arm) else f"{whose}_"
        own = f"{first}{kind}:{rest}" if rest else f"{first}{kind}"
        signals[own], units[own] = state[name][whole].astype(np.float64), unit[name]
    return signals, units


def open_state(folder: Path) -> TopicFile:
    """Open raven_state at the rate that it was recorded at."""
    there = [t for t in (RAVENSTATE, RAVENSTATE_100HZ) if (folder / f"{t.stem}.parquet").is_file()]
    if len(there) > 1:
        raise FileFormatError(
            f"{folder}: has {' and '.join(t.name for t in there)}; expected one, extract only that"
        )
    return topic_file(folder, there[0] if there else RAVENSTATE)


def read_first_column(
    folder: Path,
    topic: Topic,
    max_gap: float,
    span: tuple[int, int] | None = None,
    clock_steps: Sequence[ClockStep] = (),
) -> Series:
    """Read the positions of an extracted topic, which come first; see `read_series`."""
    return read_series(topic_file(folder, topic), topic.columns[0].names, max_gap, span, clock_steps)


def read_series(
    file: TopicFile,
    columns: Sequence[str],
    max_gap: float,
    span: tuple[int, int] | None = None,
    clock_steps: Sequence[ClockStep] = (),
) -> Series:
    """Read columns of an extracted topic, in order of time, a row group at a time."""
    stamp, arrival = np.empty((2, file.rows), dtype=np.int64)
    values = np.empty((file.rows, len(columns)))
    first = 0
    for group in range(file.row_groups):
        content = file.read(["stamp", "arrival", *columns], group)
        rows = slice(first, first + len(content["stamp"]))
        stamp[rows], arrival[rows] = content["stamp"], content["arrival"]
        for i, name in enumerate(columns):
            values[rows, i] = content[name]
        first = rows.stop
    return clean_series(
        file.topic.name,
        stamp,
        values,
        max_gap=max_gap,
        arrival=arrival,
        span=span,
        clock_steps=clock_steps,
    )
