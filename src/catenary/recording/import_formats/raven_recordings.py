"""A RAVEN-II's recordings: its topics on one clock, and the CSV of 252 columns without names that its group publishes.

A row of the CSV is a raven_state message with the samples of ext_jpos and measured_js nearest to it in time, each with
its own stamp. Degrees trap: everything from raven_state is as published, positions and velocities times 180/pi, metres
of insertion too; ext_jpos and measured_js are rad and m. Which columns are which is in raven2/data/columns.toml.
"""

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.config import parse_settings
from catenary.errors import FileFormatError, InputError
from catenary.files import table_ending
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
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.importer import Synchronisation, synchronise
from catenary.recording.import_formats.mapping import RecordingMapping, layout_mapping
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_files import read_table_file
from catenary.topics import SECOND


@cache
def raven_table() -> dict[str, Any]:
    """Return the layout: `widths`, and the topics that stand one behind the other in a row."""
    return tomllib.loads((files("catenary.raven2") / "data" / "columns.toml").read_text())


def read_raven(paths: Sequence[Path], *, arm: Arm = "gold", columns: Sequence[str] = ()) -> Synchronisation:
    """Bring a RAVEN-II's encoders onto the stamps of its raven_state.

    A row is a raven_state message: `q_nominal` and `qd` are its jpos and jvel, `tau` its commanded torque at the
    joint, `q_encoder` ext_jpos. Signals are q:<joint> and tau:<joint> of roll, wrist, jaws and the unused channel,
    and the further columns that are asked for. measured_js, which repeats jpos, is only reported on.

    Args:
        paths: Journal, bags, or the published CSV.
        columns: Further columns of raven_state for the log to carry, such as ("mpos", "encVals"), or ("all",).
    """
    further = further_columns(columns, arm)
    is_table = table_ending(paths[0]) == ".csv"  # which does not say of which robot it is
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
        name: {"columns": [f"{state}.{column}"], "units": unit, "optional": True}
        for name, (column, unit) in further.items()
    }
    content = mapping.model_dump(mode="json", exclude_unset=True)
    content |= {"signals": content["signals"] | signals}
    return synchronise(sources, parse_settings(content, RecordingMapping, "raven2.toml"))


def raven_columns(path: Path) -> Sources:
    """Open RAVEN-II's published CSV as the topics that it was made from, in SI."""
    table = _read_numbers(path)
    parts, first = {}, 0
    for topic in raven_table()["topics"]:
        width = 1 + sum(count for _, count in topic["columns"])
        parts[topic["name"]] = topic, table[:, first : first + width]
        first += width
    state = parts[RAVENSTATE.name][1][:, 0]
    origin = float(state[0])  # stamps count from the same instant, whichever that is
    began = round(origin * SECOND) if abs(origin) < 9e9 else 0
    streams = []
    for name, (topic, numbers) in parts.items():
        if numbers.shape[1] == 0:
            continue
        stamp = numbers[:, 0] - (origin if "stamp_from" not in topic else 0.0)
        if topic.get("stamp_from") == "its row":
            stamp = state - origin
        streams.append(_part(path, topic, stamp, numbers[:, 1:], began, is_state=name == RAVENSTATE.name))
    return Sources.of([path], [stream for stream in streams if stream is not None])


def _part(
    path: Path, topic: Mapping[str, Any], seconds: NDArray[Any], numbers: NDArray[Any], began: int, *, is_state: bool
) -> Stream | None:
    """Return a topic of the published CSV; a sample that stands in two rows is one.

    A float32 written shortest is not the same number when read as a float64, so these go through float32 again.
    """
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
        return None
    known = STATE_COLUMNS if is_state else {}
    columns: dict[str, NDArray[Any]] = {}
    first = 0
    for name, width in topic["columns"]:
        values = numbers[timed, first : first + width]
        labels = [str(i) for i in range(width)] if name != "force" else list("xyz")
        if name in known:
            labels = list(known[name].labels)
            if not known[name].whole and name not in ("pos", "pos_d"):
                with np.errstate(over="ignore"):  # beyond a float32 is infinite, and the row is left out
                    values = values.astype(np.float32).astype(np.float64)
            values = values * known[name].to_si
        columns |= {f"{name}[{x}]" if x else name: v for x, v in zip(labels, values.T, strict=True)}
        first += width
    stamp = began + np.rint(seconds[timed] * SECOND).astype(np.int64)
    return Stream(topic["name"], topic["type"], columns, len(stamp), stamp)


def _read_numbers(path: Path) -> NDArray[Any]:
    (table,) = read_table_file(path)
    widths = raven_table()["widths"]
    if len(table.columns) not in widths:
        raise FileFormatError(
            f"{path}: {len(table.columns)} columns of numbers, expected RAVEN-II's {widths[0]}, or {widths[1]} with "
            f"force; `catenary import {path}` proposes how to read others"
        )
    return np.column_stack(list(table.columns.values())).astype(np.float64)
