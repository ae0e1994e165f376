"""The CSV that RAVEN-II's group publishes: 252 columns, no header line, in the numbers that the robot publishes.

A row is a raven_state message with the samples of ext_jpos and measured_js nearest to it in time, each with its own
stamp. Degrees trap: everything from raven_state is as published, positions and velocities times 180/pi, metres of
insertion too; ext_jpos and measured_js are rad and m. Column 0 is ext_jpos's stamp minus the first state stamp;
columns 4 and 12 are measured_js's and raven_state's stamps as they are [s]. `dt` is not in the layout.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import FileFormatError, InputError
from catenary.files import written_whole
from catenary.recording.clock_steps import without_steps
from catenary.recording.importers import is_number
from catenary.recording.series import Series, clean_series
from catenary.recording.synchronise import (
    Synchronisation,
    SynchroniseOptions,
    build_log,
    needed_columns,
    open_state,
    read_first_column,
    state_columns,
)
from catenary.recording.topics import (
    EXT_JPOS,
    JOINTS,
    RAVENSTATE,
    SECOND,
    Arm,
    TopicColumn,
    measured_topic,
)

MOST_SECONDS = 9e9  # that 64 bits of nanoseconds hold
STATE_FIELDS = (
    "jpos", "runlevel", "sublevel", "last_seq", "type", "pos", "ori", "ori_d", "pos_d", "encVals", "dac_val", "tau",
    "mpos", "mvel", "jvel", "mpos_d", "jpos_d", "grasp_d", "encoffsets", "jac_vel", "jac_f",
)  # fmt: skip
WIDTH, WIDTH_WITH_FORCE = 252, 256
EXT_STAMP, MEASURED_STAMP, STATE_STAMP, STATE = 0, 4, 12, 13  # columns where each part begins
_COLUMNS = {column.name: column for column in RAVENSTATE.columns}
STATE_COLUMNS: tuple[TopicColumn, ...] = tuple(_COLUMNS[name] for name in STATE_FIELDS)


def write_raven_csv(folder: Path, path: Path, *, arm: Arm = "gold", max_gap: float = 0.05) -> int:
    """Write an extraction in the published layout without force, in bounded memory.

    Args:
        folder: What `extract` wrote.
        path: The file; replaced if it is there.
        arm: Whose measured_js.
        max_gap: A sample further away than this [s] is left out: its stamp and numbers are `nan`.

    Returns:
        Number of rows.
    """
    file = open_state(folder)
    told = file.read(["stamp", "arrival"])
    stamps, steps = without_steps(told["stamp"], told["arrival"])
    topics = (EXT_JPOS, measured_topic(arm))
    parts = [read_first_column(folder, topic, max_gap, clock_steps=steps) for topic in topics]
    rows = 0
    names = [name for column in STATE_COLUMNS for name in column.names]
    options = pa.csv.WriteOptions(include_header=False, quoting_style="none")
    with written_whole(path) as out:
        first = int(stamps[0]) if file.rows else 0
        for group in range(file.row_groups):
            content = file.read(names, group)
            stamp_ns = stamps[rows : rows + len(content[names[0]])]
            blocks: list[NDArray[Any]] = [*_nearest(parts[0], stamp_ns, max_gap, first)]
            blocks += [*_nearest(parts[1], stamp_ns, max_gap), stamp_ns / SECOND]
            blocks += [_published(column, content[name]) for column in STATE_COLUMNS for name in column.names]
            table = pa.table(blocks, names=[str(i) for i in range(len(blocks))])
            pa.csv.write_csv(table, out, options)
            rows += len(stamp_ns)
    return rows


def read_raven_csv(path: Path, *, columns: Sequence[str] = ()) -> Synchronisation:
    """Read the published CSV, with or without force, into a log as `synchronise` makes it.

    It is the log of the gold arm; the file, which may begin with a line of names, does not say of which robot.
    `columns` are further ones for the log to carry, ("all",) every one that the file has; see `synchronise`. Forces
    become the signals force_x, force_y, force_z [N] (of the state's row, as they stand).
    """
    options = SynchroniseOptions(columns=columns)
    table = _read_numbers(path)
    if len(table) == 0:
        raise InputError(f"{path}: has no rows")
    origin = table[0, STATE_STAMP]  # columns 4 and 12 count from the same instant, whichever that is
    state_s = table[:, STATE_STAMP] - origin
    if not (np.abs(state_s) < MOST_SECONDS).all():
        raise FileFormatError(
            f"{path}: column {STATE_STAMP}, the state's stamp, is not finite, or spans more than {MOST_SECONDS:g} s"
        )
    state = _from_table(table)
    clean = clean_series("raven_state", _ns(state_s), state, max_gap=options.max_gap)
    span = (int(clean.stamp[0]), int(clean.stamp[-1]))
    encoder = _part(table, "ext_jpos", EXT_STAMP, 0.0, 3, options.max_gap, span)
    measured = _part(table, "measured_js", MEASURED_STAMP, origin, len(JOINTS), options.max_gap, span)
    if encoder is None:
        raise InputError(f"{path}: columns 0 to 3, ext_jpos, are finite in no row")
    names = [name for column in STATE_COLUMNS for name in column.names]
    wanted = {*needed_columns(options.arm), *state_columns(columns)}
    found = build_log(
        name=path.stem,
        robot=None,
        simulated=False,
        state={name: clean.values[:, names.index(name)] for name in names if name in wanted},
        state_stamp=clean.stamp,
        encoder=encoder,
        options=options,
        force=clean.values[:, len(names) :] if table.shape[1] == WIDTH_WITH_FORCE else None,
        reports=(clean.report, encoder.report, *(() if measured is None else (measured.report,))),
    )
    return replace(found, log=replace(found.log, began=float(origin) + found.log.began))


def _nearest(series: Series, stamp: NDArray[np.int64], max_gap: float, origin: int = 0) -> Iterator[Floats]:
    """Stamp [s] and numbers of the samples nearest in time, column by column."""
    right = np.clip(np.searchsorted(series.stamp, stamp), 0, len(series.stamp) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.abs(series.stamp[left] - stamp) <= np.abs(series.stamp[right] - stamp)
    index = np.where(nearer, left, right)
    near = np.abs(series.stamp[index] - stamp) <= max_gap * SECOND
    yield np.where(near, (series.stamp[index] - origin) / SECOND, np.nan)
    for column in series.values.T:
        yield np.where(near, column[index], np.nan)


def _published(column: TopicColumn, values: NDArray[Any]) -> NDArray[Any]:
    """Numbers in the robot's own units and type: the float32 or whole number that was in the message."""
    if column.whole:
        return values
    if column.path in ("pos", "pos_d"):
        return np.rint(values / column.to_si).astype(np.int32)
    return (values / column.to_si).astype(np.float32)


def _from_table(table: Floats) -> Floats:
    """State columns and, if any, force, in SI (N, k).

    A float32 written shortest is not the same number when read as a float64, so these go through float32 again.
    """
    scales = [column.to_si for column in STATE_COLUMNS for _ in column.labels]
    end = STATE + len(scales)
    state = table[:, STATE:end].copy()
    single = np.array(
        [not c.whole and c.path not in ("pos", "pos_d") for c in STATE_COLUMNS for _ in c.labels]
    )
    with np.errstate(over="ignore"):  # beyond a float32 is infinite, and the row is left out
        state[:, single] = state[:, single].astype(np.float32)
    state *= np.array(scales)
    force = table[:, end + 1 :] if table.shape[1] == WIDTH_WITH_FORCE else np.zeros((len(table), 3))
    return np.hstack([state, force])


def _part(
    table: Floats, name: str, column: int, origin: float, width: int, max_gap: float, span: tuple[int, int]
) -> Series | None:
    """Samples with their own stamps, rows where there was none left out; the same sample in two rows is one."""
    part = table[:, column : column + 1 + width]
    part = part[np.isfinite(part).all(axis=1) & (np.abs(part[:, 0] - origin) < MOST_SECONDS)]
    if len(part) == 0:
        return None
    fresh = np.ones(len(part), dtype=bool)
    fresh[1:] = (np.diff(part, axis=0) != 0.0).any(axis=1)
    part = part[fresh]
    return clean_series(name, _ns(part[:, 0] - origin), part[:, 1:], max_gap=max_gap, span=span)


def _ns(seconds: Floats) -> NDArray[np.int64]:
    return np.rint(seconds * SECOND).astype(np.int64)


def _read_numbers(path: Path) -> Floats:
    if not path.is_file():
        raise FileFormatError(f"{path}: no such file")
    with path.open("rb") as file:
        head = file.readline(100_000).decode(errors="replace").strip().split(",")
    if len(head) not in (WIDTH, WIDTH_WITH_FORCE):
        raise FileFormatError(
            f"{path}: {len(head)} columns, expected RAVEN-II's {WIDTH}, or {WIDTH_WITH_FORCE} with force; "
            f"`catenary import {path}` proposes how to read others"
        )
    names = [str(i) for i in range(len(head))]
    try:
        read = pa.csv.ReadOptions(column_names=names, skip_rows=0 if is_number(head[0]) else 1)
        convert = pa.csv.ConvertOptions(
            column_types={name: pa.float64() for name in names}, null_values=["", "nan", "NaN", "-nan"]
        )
        table = pa.csv.read_csv(path, read, convert_options=convert)
    except (pa.ArrowException, OSError, MemoryError) as error:
        raise FileFormatError(f"{path}: cannot be read as RAVEN-II's CSV: {error}") from error
    return np.column_stack([column.to_numpy() for column in table.columns]).astype(np.float64)
