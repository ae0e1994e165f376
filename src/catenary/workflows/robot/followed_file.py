"""A motion in a file: rows of joint positions with their times, whose units the file states."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from catenary.archives import read_arrays
from catenary.arrays import Floats, frozen
from catenary.documents import cut, no_file
from catenary.errors import FileFormatError, InputError
from catenary.files import TEXT_ENDINGS, table_ending
from catenary.plant import MotionLog
from catenary.recording.import_formats.csv_files import TextTable
from catenary.recording.logs import read_parquet
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.trajectories.zigzag import BLEND, ROWS_PER_SECOND
from catenary.units import TO_SI

SCALE = {unit: TO_SI[unit] for unit in ("rad", "m", "deg", "mm")}
SECONDS = {"s": 1.0, "ms": 1e-3}
PUBLISHED_UNITS = ("rad", "rad", "m")  # of the zig-zags that RAVEN-II's group published
_HEAD = re.compile(r"^(?P<name>[^\[\]]+?)\s*\[(?P<unit>[^\[\]]+)\]$")


@dataclass(frozen=True)
class FollowedFile:
    """N rows of joint positions."""

    name: str
    joint_names: tuple[str, ...] | None  # None where the file names no joints: those that come first
    joint_units: tuple[str, ...]  # rad or m
    time: Floats  # (N,) [s] from 0 on, rising
    q: Floats  # (N, k) [rad|m]
    notes: tuple[str, ...] = ()

    def trajectory(self, blend: float = BLEND) -> SmoothedPath:
        """Return the motion along the rows, at rest at both ends; velocities are averaged over `blend` seconds."""
        if not 0.0 < blend < np.inf:
            raise InputError(f"blend: expected more than 0 s, got {blend}")
        return SmoothedPath.through(self.time, self.q, blend)

    def leaves_rows(self, trajectory: SmoothedPath, blend: float = BLEND) -> Floats:
        """Return the largest distance of the motion from the rows at their times, (k,) [rad|m]."""
        q, _, _ = trajectory.sample(self.time + 0.5 * blend)
        return np.asarray(np.abs(q - self.q).max(axis=0))


def read_followed_file(path: Path, *, rows_per_second: float | None = None) -> FollowedFile:
    """Read a motion; `rows_per_second` of a file without times, that of the published zig-zags when None.

    A table of text with units in its heading (`time [s],shoulder [deg]`), or that of `catenary excitation`; numbers
    alone in the layout of the published zig-zags (rad, rad, m); a motion log, `.parquet`; an `.npz` with `q` or `q_des`
    (N, k), `t` (N,) [s], `units` and `joint_names` (k,).
    """
    if not path.is_file():
        raise FileFormatError(no_file(path))
    if rows_per_second is not None and not 0.0 < rows_per_second < np.inf:
        raise InputError(f"--rows-per-second: expected more than 0, got {rows_per_second}")
    ending = table_ending(path)
    if ending in TEXT_ENDINGS:
        found = _read_text(path, rows_per_second)
    elif ending == ".parquet":
        found = _of_log(path, read_parquet(path))
    elif ending == ".npz":
        found = _read_npz(path)
    else:
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected {", ".join(TEXT_ENDINGS)}, .parquet or .npz')
    if rows_per_second is not None and found.joint_names is not None:
        raise InputError(f"{path}: states its times; --rows-per-second is for files without")
    return _checked(path, found)


def _read_text(path: Path, rows_per_second: float | None) -> FollowedFile:
    table = TextTable(path)
    blocks = list(table.blocks())
    if not blocks:
        raise FileFormatError(f"{path}: has no row of numbers")
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    odd = next((column for column in table.head.columns if column.kind == "text"), None)
    if odd is not None:
        where = f", {odd.odd}" if odd.odd else ""
        raise FileFormatError(f'{path}: column "{cut(odd.name)}": expected numbers, got text{where}')
    values = np.column_stack([np.asarray(numbers, dtype=float) for numbers in columns.values()])
    if not table.head.is_named:
        if values.shape[1] != len(PUBLISHED_UNITS):
            raise FileFormatError(
                f"{path}: numbers without a heading, {values.shape[1]} columns: expected a heading such as "
                f"time [s],shoulder [deg],..., or the published zig-zags' {len(PUBLISHED_UNITS)} columns in rad, rad, m"
            )
        rate = ROWS_PER_SECOND if rows_per_second is None else rows_per_second
        note = f"{path.name}: no heading: taken as rad, rad, m, {rate:g} rows a second, as the published zig-zags"
        return FollowedFile(path.name, None, PUBLISHED_UNITS, np.arange(len(values)) / rate, frozen(values), (note,))
    heads = [_HEAD.match(name) for name in columns]
    plain = [name for name, head in zip(columns, heads, strict=True) if head is None]
    if plain:
        raise FileFormatError(f'{path}: column "{plain[0]}" has no unit: expected NAME [UNIT], as in time [s]')
    names = [head["name"] for head in heads if head]
    units = [head["unit"] for head in heads if head]
    if names[0] not in ("time", "t") or units[0] not in SECONDS:
        raise FileFormatError(f'{path}: first column "{names[0]} [{units[0]}]": expected time [s] or time [ms]')
    positions = [k for k, name in enumerate(names) if name.startswith("q:")]
    if positions:  # velocities and accelerations stand beside them
        names = [names[0], *(names[k].removeprefix("q:") for k in positions)]
        units = [units[0], *(units[k] for k in positions)]
        values = values[:, [0, *positions]]
    found = _in_si(path, names[1:], units[1:], values[:, 0] * SECONDS[units[0]], values[:, 1:])
    return replace(found, notes=tuple(f"{path.name}: {note}" for note in table.notes[len(table.head.notes) :]))


def _of_log(path: Path, log: MotionLog) -> FollowedFile:
    if log.time is None:
        raise FileFormatError(f"{path}: a motion log without times; it cannot be followed")
    if len(log.starts) > 1:
        raise FileFormatError(f"{path}: holds {len(log.starts)} recordings; give one")
    return FollowedFile(path.name, log.joint_names, log.joint_units, log.time, log.q_nominal)


def _read_npz(path: Path) -> FollowedFile:
    content = read_arrays(path)
    key = next((key for key in ("q", "q_des") if key in content), None)
    missing = [name for name in ("t", "units", "joint_names") if name not in content]
    if key is None or missing:
        raise FileFormatError(f"{path}: lacks {', '.join([*missing, *([] if key else ['q or q_des'])])}")
    time, q = (np.asarray(content[name], dtype=float) for name in ("t", key))
    return _in_si(path, content["joint_names"].tolist(), content["units"].tolist(), time, q)


def _in_si(path: Path, names: list[str], units: list[str], time: Floats, q: Floats) -> FollowedFile:
    """Return a motion of joints (N, k) that are in k units of SCALE."""
    if not units or not set(units) <= set(SCALE) or q.ndim != 2 or q.shape[1] != len(units):
        raise FileFormatError(
            f"{path}: expected joint positions (N, k) in k units among {', '.join(SCALE)}; "
            f"got {q.shape} in {', '.join(units) or 'none'}"
        )
    si, scale = zip(*(SCALE[unit] for unit in units), strict=True)
    return FollowedFile(path.name, tuple(names), si, time, frozen(q * np.array(scale)))


def _checked(path: Path, found: FollowedFile) -> FollowedFile:
    """Return a motion whose times begin at zero; refuse one without rows, or whose times do not rise."""
    if found.time.shape != (len(found.q),) or len(found.q) == 0:
        raise InputError(f"{path}: {len(found.q)} rows with times of shape {found.time.shape}")
    if not (np.isfinite(found.q).all() and np.isfinite(found.time).all()):
        row = int(np.argmin(np.isfinite(found.q).all(axis=1) & np.isfinite(found.time)))
        raise InputError(f"{path}: row {row + 1} holds a number that is not finite")
    steps = np.diff(found.time)
    if not (steps > 0.0).all():
        raise InputError(f"{path}: row {int(np.argmin(steps > 0.0)) + 2}: time does not rise")
    return replace(found, time=frozen(found.time - found.time[0]))
