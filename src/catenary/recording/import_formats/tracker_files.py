"""What OptiTrack's Motive exports, as poses in SI by name.

A body's columns are `NAME.position.x` [m] and `NAME.orientation.w`, as a message's. What was not seen is NaN.
"""

import csv
import re
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv

from catenary.documents import cut, reading
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream
from catenary.recording.parquet_files import ARROW

_HEAD = 16  # lines in which Motive's names stand, at most
_METRES = {"meters": 1.0, "centimeters": 1e-2, "millimeters": 1e-3}
_FIRST = "Format Version"


def is_tracker_file(path: Path) -> bool:
    """Return whether a text file is Motive's export, by its first cell."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        return file.read(len(_FIRST)) == _FIRST


def read_tracker_file(path: Path) -> Stream:
    """Read Motive's CSV: a line of settings, then lines of types, names, IDs and axes above the columns of poses."""
    from scipy.spatial.transform import Rotation

    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        head = [next(csv.reader([line]), []) for line in islice(file, _HEAD)]
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
    is_euler = re.fullmatch("[XYZ]{3}", turns) is not None
    if is_euler:
        notes.append(f"its orientations are angles, read as turns about axes that turn with it, {' then '.join(turns)}")
    if began := stated.get("Capture Start Time"):
        notes.append(f"its time counts from its own begin, {cut(began)} of that computer")
    wanted, left = {"1": ("time", 1.0)}, dict[str, None]()
    for i, (kind, name, part, axis) in enumerate(zip(kinds, names, parts, head[axes_at], strict=False)):
        scale = {"Position": _METRES[length], "Rotation": 1.0}.get(part, 0.0)
        what = "orientation" if part == "Rotation" else "position"
        column = (f"{name}{' (solved)' * (kind == 'Rigid Body Marker')}.{what}.{axis.lower()}", scale)
        if scale and (name.startswith("Unlabeled") or column in wanted.values()):
            left[name] = None
        elif scale:
            wanted[str(i)] = column
    notes += [f"markers without a name of their own were left out: {', '.join(map(cut, list(left)[:5]))}"] * bool(left)
    names = [str(i) for i in range(len(head[axes_at]))]
    of_file = pa.csv.ReadOptions(use_threads=False, column_names=names, skip_rows=axes_at + 1)
    numbers = pa.csv.ConvertOptions(column_types=dict.fromkeys(wanted, pa.float64()), include_columns=list(wanted))
    with reading(path, "Motive's export", ARROW):
        table = pa.csv.read_csv(path, of_file, convert_options=numbers)
    if not table.num_rows:
        raise FileFormatError(f"{path}: has no row with a pose")
    columns = {name: scale * table.column(i).to_numpy() for i, (name, scale) in wanted.items()}
    for base in [name.removesuffix(".x") for name in columns if is_euler and name.endswith("orientation.x")]:
        angles = np.column_stack([columns[f"{base}.{axis.lower()}"] for axis in turns])
        seen = np.isfinite(angles).all(axis=1)
        q = np.full((len(angles), 4), np.nan)
        q[seen] = Rotation.from_euler(turns, angles[seen], degrees=True).as_quat()
        columns |= {f"{base}.{axis}": q[:, i] for i, axis in enumerate("xyzw")}
    return Stream(path.stem, "table", columns, table.num_rows, notes=tuple(notes))
