"""Layouts that need no mapping from their reader: each is a mapping in TOML, recognised by the files it is of.

A row of RAVEN-II's CSV is a raven_state message with the samples of ext_jpos and measured_js nearest to it in time,
each with its own stamp. Degrees trap: everything from raven_state is as published, positions and velocities times
180/pi, metres of insertion too; ext_jpos and measured_js are rad and m. raven2/data/columns.toml says which is which.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import content_in_words, read_arrays
from catenary.arrays import Floats
from catenary.dvrk_psm import psm_topic
from catenary.errors import FileFormatError, InputError, to_import
from catenary.file_formats import format_of
from catenary.plant import MotionLog, joint_indices, nameless
from catenary.raven2.topics import (
    EXT_JPOS,
    RAVENSTATE,
    RAVENSTATE_100HZ,
    ROBOT,
    STATE_COLUMNS,
    Arm,
    further_columns,
    measured_topic,
)
from catenary.raven2.transmission import CALIBRATED, COUPLING, JOINT_TORQUE
from catenary.recording.bag_reader import open_recordings
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.importer import Synchronisation, synchronise
from catenary.recording.import_formats.mapping import Signal, layout_mapping
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.table_files import read_table_file, streams_of_arrays
from catenary.recording.parquet_files import open_parquet
from catenary.robots.model import RobotModel
from catenary.topics import SECOND

# topics that stand one behind the other in a row of the published CSV, and `widths`
_RAVEN_TABLE: dict[str, Any] = tomllib.loads((files("catenary.raven2") / "data" / "columns.toml").read_text("utf-8"))
_STATE_ARRAYS = {"t", "jpos", "jpos_d", "pos", "pos_d"}


MOTION_LOG = "catenary's motion log"
_RAVEN_CSV = "RAVEN-II's published CSV"
_COMMAND_LOG = "commanded and measured joints (q_des, q_act, ok)"
TORQUE_LOG = "positions and torques (q, tau, and dq, fs or t)"  # whose joints' names and units the robot has
_RAVEN_BAG = "RAVEN-II's topics: raven_state and the external encoders"
_RAVEN_STATE = "RAVEN-II's recorded state (jpos, jpos_d, pos, pos_d)"


def read_psm(paths: Sequence[Path], namespace: str) -> Synchronisation:
    """Read a PSM's bags: a tracker's joint positions interpolated at the stamps of measured_js.

    Args:
        paths: The bags.
        namespace: Name of the arm: /PSM1.
    """
    psm_topic(namespace, "measured_js")  # refuses a namespace that no PSM has
    return synchronise(Sources(paths), layout_mapping("recording/dvrk_psm", namespace=f"/{namespace.strip('/')}"))


def layout_of_files(paths: Sequence[Path]) -> str | None:
    """Return the known layout of a recording's files; None for another, which needs a mapping."""
    if paths and all(format_of(path).holds == "messages" and path.exists() for path in paths):
        try:
            topics = {tuple(topic) for source in open_recordings(paths) for topic in source.topics}
        except FileFormatError:
            return None
        is_there = [(topic.name, topic.type) in topics for topic in (RAVENSTATE, RAVENSTATE_100HZ, EXT_JPOS)]
        return _RAVEN_BAG if is_there in ([True, False, True], [False, True, True]) else None
    if len(paths) != 1 or not paths[0].is_file():
        return None
    path, ending = paths[0], format_of(paths[0]).ending
    if ending == ".parquet":
        return MOTION_LOG if b"catenary" in (open_parquet(path).schema_arrow.metadata or {}) else None
    if ending == ".csv":
        with path.open("rb") as file:
            width = file.readline(100_000).count(b",") + 1
        return _RAVEN_CSV if width in _RAVEN_TABLE["widths"] else None
    names = set(read_arrays(path)) if ending == ".npz" else set[str]()
    if {"q_des", "q_act", "ok"} <= names:
        return _COMMAND_LOG
    if "q" in names and names & {"tau", "effort"}:
        return TORQUE_LOG
    return _RAVEN_STATE if names >= _STATE_ARRAYS else None


def read_layout(
    paths: Sequence[Path], layout: str, *, model: RobotModel | None = None, units: Sequence[str] | None = None
) -> MotionLog:
    """Read a recording of a known layout other than a motion log.

    Args:
        paths: Its files.
        layout: Name of the layout.
        model: Robot, whose side of a RAVEN-II is read.
        units: "rad" or "m" per joint, for files without.
    """
    path = paths[0]
    if layout in (_RAVEN_BAG, _RAVEN_CSV):
        arm: Arm = "green" if model is not None and model.name == ROBOT["green"] else "gold"
        return read_raven(paths, arm=arm).log
    if layout == TORQUE_LOG and model is not None:
        return read_torques(path, model)
    if layout == _RAVEN_STATE:
        return synchronise(Sources(paths), layout_mapping("raven2/state")).log
    if model is not None:
        return read_commands(path, units=units or model.joint_units, joint_names=model.joint_names)
    return read_commands(path, units=units)


def read_commands(
    path: Path, *, units: Sequence[str] | None = None, joint_names: Sequence[str] | None = None
) -> MotionLog:
    """Read a `.npz` of commanded and measured joint positions, in the layout of Hwang et al. (RA-L 2020).

    Arrays: `q_des` (N, n), `q_act` (N, n) in rad and m, `ok` (N,) bool, and, if there, `t` (N,) in s, `tau` (N, n),
    `dq` (N, n), `units`, `joint_names` (n,) strings. A time stamp that goes back begins another recording. Units of
    `joint_names` are as given or the file's; where neither says, three and six joints are taken to be in the order of
    the RAVEN-II and the da Vinci PSM (rad, rad, m, rad, rad, rad), and the log says so.
    """
    content = read_arrays(path)
    missing = next((key for key in ("q_des", "q_act", "ok") if key not in content), None)
    if missing is not None:
        expected = f"a command log has q_des (N, n), q_act (N, n) and ok (N,); {content_in_words(content)}"
        advice = f"; {to_import(path)}" * ("structure" not in content)
        raise FileFormatError(f'{path}: array "{missing}" is missing; {expected}{advice}')
    sources = _sources(path, content, ("q_des", "q_act", "tau", "dq"), ("ok", "t"))
    mapping = layout_mapping("recording/command_log")
    options = {"joint_names": tuple(joint_names or ()), "joint_units": tuple(units or ())}
    return synchronise(sources, mapping.model_copy(update=options)).log


_TORQUES = ("tau", "effort", "current")  # arrays of a torque log, the first that it has; the others raw


def read_torques(path: Path, model: RobotModel, *, raw: bool = False, joints: Sequence[str] = ()) -> MotionLog:
    """Read a `.npz` of a robot's positions and torques; see `recording.logs.read_torque_log`."""
    content = read_arrays(path)
    torque = next((name for name in _TORQUES if name in content), None)
    if "q" not in content or torque is None:
        raise FileFormatError(
            f"{path}: expected arrays q (N, n) and tau (N, n), and dq, fs or t where the robot moves; "
            f"{content_in_words(content)}; {to_import(path)}"
        )
    sources = _sources(path, content, ("q", *_TORQUES, "dq"), ("t",))
    mapping = layout_mapping("recording/torque_log", torque=torque)
    n = content["q"].shape[-1] if content["q"].ndim == 2 else 1
    unnamed = joints if n == len(joints) else model.joint_names if n == model.n else nameless(n)
    names = sources.streams[0].texts.get("joint_names") or unnamed
    own = dict(zip(model.joint_names, model.joint_units, strict=True))
    stated = sources.streams[0].texts.get("units")
    units = stated or tuple(own.get(name, "rad") for name in names)
    options = {"joint_names": tuple(names), "joint_units": units, "default_robot": model.name}
    log = synchronise(sources, mapping.model_copy(update=options)).log
    if not joints:
        log = log.of_robot(model, model.name)
    if raw or torque == "tau":
        return log
    scale = None if model.actuation is None else model.actuation.effort_scale
    if scale is None:
        raise InputError(
            f'{path}: has raw efforts, and robot "{model.name}" gives no effort_scale; expected tau [Nm or N], '
            "or catenary identify --currents with a known --load"
        )
    return with_effort_scale(log, model, scale)


def with_effort_scale(log: MotionLog, model: RobotModel, scale: Floats) -> MotionLog:
    """Return a recording whose torques are its raw efforts times the robot's scale (n,) [Nm or N per unit]."""
    places = joint_indices(log, model, whose=f'robot "{model.name}"', of="the recording is of")
    assert log.tau is not None  # for the type checker
    return replace(log, tau=log.tau * scale[places], notes=(*log.notes, "raw efforts times the robot's effort_scale"))


def _sources(
    path: Path, content: Mapping[str, NDArray[Any]], per_joint: Sequence[str], per_row: Sequence[str]
) -> Sources:
    """Open arrays of a layout; each has a row for each of its first one's, and in it a number a joint."""
    first = content[per_joint[0]].shape
    if len(first) != 2:
        raise FileFormatError(f"{path}: {per_joint[0]}: expected shape (N, n), got {first}")
    if 0 in first:
        raise FileFormatError(f"{path}: {per_joint[0]} is empty: {first}")
    numbers = dict.fromkeys(per_joint, first) | dict.fromkeys(per_row, first[:1])
    for name, shape in numbers.items():
        if name not in content:
            continue
        if content[name].dtype.kind not in "biuf":
            raise FileFormatError(f"{path}: {name}: expected numbers, got {content[name].dtype}")
        if content[name].shape != shape:
            raise FileFormatError(f"{path}: {name}: expected shape {shape}, got {content[name].shape}")
    return Sources.of([path], streams_of_arrays(path, content, rows_first=True))


def read_raven(paths: Sequence[Path], *, arm: Arm = "gold", columns: Sequence[str] = ()) -> Synchronisation:
    """Read a RAVEN-II's recording: encoders interpolated at the stamps of raven_state.

    `q_nominal` and `qd` are jpos and jvel, `tau` the commanded torque at the joint, `q_encoder` ext_jpos; signals are
    q:<joint> and tau:<joint> of roll, wrist, jaws and the unused channel. measured_js, which repeats jpos, is only
    reported on.

    Args:
        paths: Bags, or a table.
        arm: Side.
        columns: Further columns, such as ("mpos", "encVals"), or ("all",).
    """
    further = further_columns(columns, arm)
    is_table = format_of(paths[0]).ending == ".csv"  # which does not say of which robot it is
    sources = raven_columns(paths[0]) if is_table else Sources(paths)
    there = {stream.name for stream in sources.streams}
    states = [topic.name for topic in (RAVENSTATE, RAVENSTATE_100HZ) if topic.name in there]
    if len(states) > 1:
        raise FileFormatError(f"{paths[0]}: has {' and '.join(states)}; expected one")
    state = states[0] if states else RAVENSTATE.name
    mapping = layout_mapping(
        "raven2/topics",
        state=state,
        arm=arm,
        robot="" if is_table else ROBOT[arm],
        measured_js=measured_topic(arm).name,
        coupling=COUPLING.tolist(),
        cable_scale=[JOINT_TORQUE[joint] for joint in CALIBRATED],
        **{f"{joint}_scale": JOINT_TORQUE[joint] for joint in JOINT_TORQUE if joint not in CALIBRATED},
    )
    signals = {
        name: Signal(columns=(f"{state}.{column}",), units=unit, optional=True)
        for name, (column, unit) in further.items()
    }
    return synchronise(sources, mapping.model_copy(update={"signals": mapping.signals | signals}))


def raven_columns(path: Path) -> Sources:
    """Open RAVEN-II's published CSV as the topics that it was made from, in SI."""
    (read,) = read_table_file(path)
    widths = _RAVEN_TABLE["widths"]
    if len(read.columns) not in widths:
        raise FileFormatError(
            f"{path}: {len(read.columns)} columns of numbers, expected RAVEN-II's {widths[0]}, or {widths[1]} with "
            f"force; {to_import(path)}"
        )
    table = np.column_stack(list(read.columns.values())).astype(np.float64)
    parts, first = {}, 0
    for topic in _RAVEN_TABLE["topics"]:
        width = 1 + sum(count for _, count in topic["columns"])
        parts[topic["name"]] = topic, table[:, first : first + width]
        first += width
    state = parts[RAVENSTATE.name][1][:, 0]
    origin = float(state[0])  # stamps count from the same instant, whichever that is
    began = round(origin * SECOND) if abs(origin) < 9e9 else 0
    streams = []
    for topic, numbers in (part for part in parts.values() if part[1].shape[1]):
        stamp = numbers[:, 0] - (origin if "stamp_from" not in topic else 0.0)
        stamp = state - origin if topic.get("stamp_from") == "its row" else stamp
        streams += _part(path, topic, stamp, numbers[:, 1:], began)
    return Sources.of([path], streams)


def _part(
    path: Path, topic: Mapping[str, Any], seconds: NDArray[Any], numbers: NDArray[Any], began: int
) -> list[Stream]:
    """Return a topic of the published CSV, if it is there; a sample that stands in two rows is one."""
    is_state = topic["name"] == RAVENSTATE.name
    with np.errstate(invalid="ignore"):
        timed = np.abs(seconds) < 9e9
    if is_state and not timed.all():
        raise FileFormatError(f"{path}: the stamp of {topic['name']} is not finite, or spans more than 9e+09 s")
    if not is_state:
        timed &= np.isfinite(numbers).all(axis=1)
        same = (seconds[1:] == seconds[:-1]) & (numbers[1:] == numbers[:-1]).all(axis=1)
        timed[1:] &= ~same
    if not timed.any():
        if topic["name"] == EXT_JPOS.name:
            raise InputError(f"{path}: columns 0 to 3, ext_jpos, are finite in no row")
        return []
    known = STATE_COLUMNS if is_state else {}
    columns: dict[str, NDArray[Any]] = {}
    first = 0
    for name, width in topic["columns"]:
        values = numbers[timed, first : first + width]
        labels = [str(i) for i in range(width)] if name != "force" else list("xyz")
        if name in known:
            labels = list(known[name].labels)
            # a float32 written shortest is not the same number when read as a float64
            if not known[name].whole and name not in ("pos", "pos_d"):
                with np.errstate(over="ignore"):  # beyond a float32 is infinite, and the row is left out
                    values = values.astype(np.float32).astype(np.float64)
            values = values * known[name].to_si
        columns |= {f"{name}[{x}]" if x else name: v for x, v in zip(labels, values.T, strict=True)}
        first += width
    stamp = began + np.rint(seconds[timed] * SECOND).astype(np.int64)
    return [Stream(topic["name"], topic["type"], columns, len(stamp), stamp)]
