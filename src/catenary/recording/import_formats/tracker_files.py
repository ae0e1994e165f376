"""What trackers' own programs export: OptiTrack's Motive and NDI's ToolTracker and Track, as poses in SI by name.

A body's columns are `NAME.position.x` [m] and `NAME.orientation.w`, as a message's. What was not seen is NaN.
"""

import csv
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream

_HEAD = 16  # lines in which Motive's names stand, at most
_METRES = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}
_NDI_RATE = 60.0  # [Hz] of the frames that an NDI tracker counts


def is_tracker_file(path: Path) -> bool:
    """Return whether a text file is a tracker's export, by its first cell."""
    return _first_cell(_head(path)) in _KINDS


def read_tracker_file(path: Path) -> Stream | None:
    """Return the poses of a tracker's export; None of another file."""
    head = _head(path)
    read = _KINDS.get(_first_cell(head))
    return None if read is None else read(path, head)


def _head(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        return [next(csv.reader([line]), []) for line in islice(file, _HEAD)]


def _first_cell(head: list[list[str]]) -> str:
    return head[0][0].strip() if head and head[0] else ""


def _motive(path: Path, head: list[list[str]]) -> Stream:
    """Read Motive's CSV: a line of settings, then lines of types, names, IDs and axes above the columns."""
    stated = dict(zip(head[0][::2], head[0][1::2], strict=False))
    length, turns = stated.get("Length Units", "").lower(), stated.get("Rotation Type", "Quaternion")
    axes_at = next((i for i, row in enumerate(head) if row and row[0] == "Frame"), None)
    if axes_at is None or axes_at < 4 or length not in _METRES:
        raise FileFormatError(
            f"{path}: is Motive's export, format {stated.get('Format Version')}: expected lines of types, names and "
            f"axes, and Length Units of {', '.join(_METRES)}, got {cut(length) or 'none'}"
        )
    rows = [[cell.strip() for cell in row] for row in head[1:axes_at] if len(row) > 2]
    kinds, names, parts, axes = rows[0], rows[1], rows[-1], head[axes_at]
    wanted, left = {1: ("time", 1.0)}, dict[str, None]()
    for i, (kind, name, part, axis) in enumerate(zip(kinds, names, parts, axes, strict=False)):
        name = f"{name} (solved)" if kind == "Rigid Body Marker" else name
        if part == "Position" and axis in "XYZ":
            column = (f"{name}.position.{axis.lower()}", _METRES[length])
        elif part == "Rotation" and axis in "XYZW" and turns == "Quaternion":
            column = (f"{name}.orientation.{axis.lower()}", 1.0)
        else:
            continue
        if column in wanted.values() or name.startswith("Unlabeled"):
            left[name] = None
        else:
            wanted[i] = column
    try:
        table = pa.csv.read_csv(
            path,
            pa.csv.ReadOptions(column_names=[str(i) for i in range(len(axes))], skip_rows=axes_at + 1),
            convert_options=pa.csv.ConvertOptions(
                column_types={str(i): pa.float64() for i in wanted}, include_columns=[str(i) for i in wanted]
            ),
        )
    except (pa.ArrowException, OSError, ValueError) as error:
        raise FileFormatError(f"{path}: cannot be read as Motive's export: {cut(str(error))}") from error
    columns = {name: table.column(str(i)).to_numpy() * scale for i, (name, scale) in wanted.items()}
    notes = [f"is Motive's export, format {stated.get('Format Version')}, in {length}"]
    if turns != "Quaternion":
        notes.append(f"its orientations are left out, as {cut(turns)}; export them with Rotation Type: Quaternion")
    notes += [f"markers without a name of their own were left out: {', '.join(map(cut, list(left)[:5]))}"] * bool(left)
    return _stream(path, columns, notes)


def _ndi(path: Path, _: list[list[str]]) -> Stream:
    """Read NDI's CSV: for each tool Frame, State, Q0 to Qz, Tx to Tz [mm], in a row with the others'."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        names, *rows = list(csv.reader(file))
    names = [name.strip() for name in names]
    starts = [i for i, name in enumerate(names) if name.startswith("Port")]
    columns, notes = dict[str, NDArray[Any]](), ["is NDI's export, in mm"]
    for begin, end in zip(starts, [*starts[1:], len(names)], strict=True):
        at = {
            name: begin + i for i, name in reversed(list(enumerate(names[begin:end])))
        }  # a tool's before its markers'
        lacks = [name for name in ("Frame", "State", "Q0", "Qx", "Qy", "Qz", "Tx", "Ty", "Tz") if name not in at]
        if lacks:
            raise FileFormatError(f"{path}: {cut(names[begin])}: has no {', '.join(lacks)}; export quaternions")
        tool = names[begin].partition(": ")[2].partition("s/n:")[0].strip() or names[begin]
        state = [row[at["State"]].strip() if at["State"] < len(row) else "MISSING" for row in rows]
        seen = np.array([each == "OK" for each in state])
        notes += [f"{cut(tool)}: not seen on {int((~seen).sum())} of {len(rows)} rows"] * (not seen.all())

        def numbers(name: str, at: dict[str, int] = at) -> NDArray[np.float64]:
            return np.array([_number(row[at[name]] if at[name] < len(row) else "") for row in rows])

        for part, fields, scale in (("position", "Tx Ty Tz", 1e-3), ("orientation", "Qx Qy Qz Q0", 1.0)):
            for axis, name in zip("xyzw", fields.split(), strict=False):
                columns[f"{tool}.{part}.{axis}"] = np.where(seen, scale * numbers(name), np.nan)
        if "time" not in columns:
            clock = next((name for name in at if name.startswith("Time")), None)
            columns["time"] = numbers(clock) if clock else numbers("Frame") / _NDI_RATE
            notes += [f"time is Frame / {_NDI_RATE:g} Hz, as an NDI tracker counts frames"] * (clock is None)
    return _stream(path, columns, notes)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _stream(path: Path, columns: dict[str, NDArray[Any]], notes: list[str]) -> Stream:
    rows = len(columns.get("time", ()))
    if rows == 0 or len(columns) < 4:
        raise FileFormatError(f"{path}: has no row with a pose")
    return Stream(path.stem, "table", columns, rows, notes=tuple(notes))


_KINDS = {"Format Version": _motive, "Tools": _ndi}  # by the first cell
