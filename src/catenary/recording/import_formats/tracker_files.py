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
    if read is None:
        return None
    columns, notes = read(path, head)
    if not len(columns.get("time", ())):
        raise FileFormatError(f"{path}: has no row with a pose")
    return Stream(path.stem, "table", columns, len(columns["time"]), notes=tuple(notes))


def _head(path: Path) -> list[list[str]]:
    """Return the first lines of a tracker's export; none of another file, whose lines may be of any length."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        if not file.read(40).startswith(tuple(_KINDS)):
            return []
        file.seek(0)
        return [next(csv.reader([line]), []) for line in islice(file, _HEAD)]


def _first_cell(head: list[list[str]]) -> str:
    return head[0][0].strip() if head and head[0] else ""


def _motive(path: Path, head: list[list[str]]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Read Motive's CSV: a line of settings, then lines of types, names, IDs and axes above the columns."""
    stated = dict(zip(head[0][::2], head[0][1::2], strict=False))
    length, turns = stated.get("Length Units", "").lower(), stated.get("Rotation Type", "Quaternion")
    axes_at = next((i for i, row in enumerate(head) if row and row[0] == "Frame"), 0)
    if axes_at < 4 or length not in _METRES:
        raise FileFormatError(
            f"{path}: is Motive's export, format {stated.get('Format Version')}: expected lines of types, names and "
            f"axes, and Length Units of {', '.join(_METRES)}, got {cut(length) or 'none'}"
        )
    kinds, names, *_, parts = [[cell.strip() for cell in row] for row in head[1:axes_at] if len(row) > 2]
    notes = [f"is Motive's export, format {stated.get('Format Version')}, in {length}"]
    if turns != "Quaternion":
        notes.append(f"its orientations are left out, as {cut(turns)}; export them with Rotation Type: Quaternion")
    wanted, left = {"1": ("time", 1.0)}, dict[str, None]()
    for i, (kind, name, part, axis) in enumerate(zip(kinds, names, parts, head[axes_at], strict=False)):
        scale = {"Position": _METRES[length], "Rotation": 1.0 if turns == "Quaternion" else 0.0}.get(part, 0.0)
        what = "orientation" if part == "Rotation" else "position"
        column = (f"{name}{' (solved)' * (kind == 'Rigid Body Marker')}.{what}.{axis.lower()}", scale)
        if scale and (name.startswith("Unlabeled") or column in wanted.values()):
            left[name] = None
        elif scale:
            wanted[str(i)] = column
    notes += [f"markers without a name of their own were left out: {', '.join(map(cut, list(left)[:5]))}"] * bool(left)
    of_file = pa.csv.ReadOptions(column_names=[str(i) for i in range(len(head[axes_at]))], skip_rows=axes_at + 1)
    numbers = pa.csv.ConvertOptions(column_types=dict.fromkeys(wanted, pa.float64()), include_columns=list(wanted))
    try:
        table = pa.csv.read_csv(path, of_file, convert_options=numbers)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise FileFormatError(f"{path}: cannot be read as Motive's export: {cut(str(error))}") from error
    return {name: scale * table.column(i).to_numpy() for i, (name, scale) in wanted.items()}, notes


def _ndi(path: Path, head: list[list[str]]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Read NDI's CSV: for each tool Frame, State, Q0 to Qz, Tx to Tz [mm], in a row with the others'."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        rows = list(csv.reader(file))[1:]
    names, columns, notes = [name.strip() for name in head[0]], dict[str, NDArray[Any]](), ["is NDI's export, in mm"]
    starts = [i for i, name in enumerate(names) if name.startswith("Port")]
    for begin, end in zip(starts, [*starts[1:], len(names)], strict=True):
        at = {
            name: begin + i for i, name in reversed(list(enumerate(names[begin:end])))
        }  # a tool's before its markers'
        fields = {"position": ("Tx", "Ty", "Tz"), "orientation": ("Q0", "Qx", "Qy", "Qz")}
        lacks = [name for name in ("Frame", "State", *fields["orientation"], *fields["position"]) if name not in at]
        if lacks:
            raise FileFormatError(f"{path}: {cut(names[begin])}: has no {', '.join(lacks)}; export quaternions")
        tool = names[begin].partition(": ")[2].partition("s/n:")[0].strip() or names[begin]
        cells = {name: [row[i].strip() if i < len(row) else "" for row in rows] for name, i in at.items()}
        seen = np.array([state == "OK" for state in cells["State"]])
        notes += [f"{cut(tool)}: not seen on {int((~seen).sum())} of {len(rows)} rows"] * (not seen.all())
        for part, own in fields.items():
            for name in own:
                scale = 1e-3 if part == "position" else 1.0
                axis = name[1].replace("0", "w")
                columns[f"{tool}.{part}.{axis}"] = np.where(seen, scale * _numbers(cells[name]), np.nan)
        clock = next((name for name in at if name.startswith("Time")), None)
        columns.setdefault("time", _numbers(cells[clock]) if clock else _numbers(cells["Frame"]) / _NDI_RATE)
        notes += [f"time is Frame / {_NDI_RATE:g} Hz, as an NDI tracker counts frames"] * (clock is None)
    return columns, list(dict.fromkeys(notes))


def _numbers(cells: list[str]) -> NDArray[np.float64]:
    """Return cells as numbers; NaN where one is none."""
    values = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        try:
            values[i] = float(cell)
        except ValueError:
            continue
    return values


_KINDS = {"Format Version": _motive, "Tools": _ndi}  # by the first cell
