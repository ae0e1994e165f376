"""An inertial unit's readings out of a recording: a bag with sensor_msgs/Imu, or a table with columns for it.

Columns are inferred from their names, as drivers and loggers write them, and units by what stands behind a name, as in
"Accelerometer X (g)".
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.bounded_parsers import cut
from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.columns import WORDS, Stream, listed, places_of
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.table_time import time_of, times_among
from catenary.units import ACCELERATION_UNITS, RATE_UNITS

_IMU_TYPE = "sensor_msgs/Imu"
_FORCE, _RATE, _STRIPPED = (WORDS["inertial"][key].split() for key in ("force", "rate", "stripped"))
# a unit behind a name: "Accelerometer X (g)", "gyro_x [deg/s]", "accel_x_mg"
_UNIT = re.compile(r"[ _]*[(\[]\s*(?P<unit>[^)\]]+?)\s*[)\]]\s*$|[_ ](?P<tail>m_s2|mps2|rad_s|radps|deg_s|dps|mg|g)$")
_MIN_READINGS = 10
_BURST_STEPS = 0.2  # of the mean step: more than half of them shorter, and readings came in bursts


@dataclass(frozen=True)
class ImuRecording:
    """Readings in the sensor's axes, in the order of their stamps as recorded."""

    time: Floats  # (N,) [s] since the first
    force: Floats  # (N, 3) [m/s2] specific force, up at rest
    rate: Floats | None  # (N, 3) [rad/s]; None without a gyroscope
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Time from the first to the newest reading [s]."""
        return float(self.time.max())


def read_imu(
    path: Path,
    *,
    topic: str | None = None,
    columns: Sequence[str] = (),
    time: str | None = None,
    matrices: tuple[Floats, Floats] | None = None,
    has_units: bool = False,
) -> ImuRecording:
    """Read the samples of an inertial unit.

    Args:
        path: Bag or table.
        topic: Topic of a bag with several Imu topics.
        columns: Columns of a table: three of the accelerometer, and three of the gyroscope if any; inferred from their
            names when empty.
        time: Column and unit of time, `t_us@us`; inferred from names and steps when None.
        matrices: Matrices (3, 3) applied to accelerometer and gyroscope, to order their axes.
        has_units: Whether the matrices convert to SI too; units in names are ignored then.
    """
    sources = Sources([path])
    stream = _stream(path, sources.streams, topic)
    names = [place.column for name in columns for place in places_of(name, [stream])]
    if names and len(names) not in (3, 6):
        raise InputError(f"columns: expected three of the accelerometer and three of the gyroscope, got {len(names)}")
    names = names or _named(stream, _FORCE, required=True) + _named(stream, _RATE, required=False)
    flags = [name for name in stream.columns if name.endswith("_covariance[0]") and "orientation" not in name]
    column, _, unit = (time or "").partition("@")
    times = times_among(stream, [column] if column else []) if stream.type == "table" else []
    whole = sources.read({stream.name: [*names, *flags, *times]}).get(stream.name, stream)
    if whole.type == "table":
        try:
            table_time = time_of(whole, (column,) if column else (), unit or None, None, today=sources.today)
        except InputError as error:
            # an import has a mapping and a rate of rows, which are not there for this
            plain = re.sub(r"time_unit, or |their rate in its place \(.*?\), or ", "", str(error))
            raise InputError(f"{plain.replace('--map time=', '--time ')} (--time COLUMN@UNIT)") from error
        if table_time is None:
            raise InputError(
                f"{path}: no column of time, such as time or t_us: --time; it has {listed(list(stream.columns))}"
            )
        stamp, why = table_time.stamp, table_time.said
    else:
        clock = whole.stamp if whole.stamp is not None and (whole.stamp > 0).all() else whole.arrival
        if clock is None:
            raise FileFormatError(f"{path}: {stream.name}: its messages have no stamps")
        stamp, why = clock, f"{stream.name}: {whole.rows} messages"
    values = np.column_stack([np.asarray(whole.columns[name], dtype=float) for name in names])
    measured, turned = (_measured(whole, name, len(values)) for name in ("linear_acceleration", "angular_velocity"))
    without = int((~measured).sum())
    missing = f"; {without} messages say (covariance -1) that they measure no acceleration" if without else ""
    there = np.isfinite(values).any(axis=1)  # a table may have rows of other sensors between
    missing += f"; {int((~there).sum())} rows have no reading" * (not there.all())
    known = (stamp > np.iinfo(np.int64).min) & measured & there
    if known.sum() < _MIN_READINGS:
        raise FileFormatError(
            f"{path}: expected at least {_MIN_READINGS} readings with a time, got {int(known.sum())}{missing}"
        )
    seconds, spread = _spread((stamp[known] - stamp[known][0]) / 1e9)
    rows = values[known]
    if not has_units:
        rows = rows * np.array([_scale(stream.titled(name), (_FORCE, _RATE)[k > 2]) for k, name in enumerate(names)])
    if matrices is not None:
        rows = np.hstack([rows[:, 3 * k : 3 * k + 3] @ matrices[k].T for k in range(rows.shape[1] // 3)])
    rate = rows[:, 3:] if rows.shape[1] == 6 and turned[known].all() else None
    if rows.shape[1] == 6 and rate is None:
        missing += "; its messages say (covariance -1) that they measure no angular velocity"
    notes = (why + missing + spread, f"read {', '.join(map(cut, names))}")
    return ImuRecording(seconds, rows[:, :3], rate, (*notes, *sources.notes))


def _measured(stream: Stream, name: str, rows: int) -> Flags:
    """Return the rows that measured a quantity: an Imu marks others by a covariance of -1."""
    column = stream.columns.get(f"{name}_covariance[0]")
    return np.ones(rows, dtype=bool) if column is None else np.asarray(column, dtype=float) != -1.0


def _spread(seconds: Floats) -> tuple[Floats, str]:
    """Return times with bursts spread: readings that came together were taken evenly since those before."""
    steps = np.diff(seconds)
    if len(steps) < _MIN_READINGS or (steps < 0.0).any():
        return seconds, ""
    mean = float(seconds[-1]) / len(steps)
    if np.mean(steps < _BURST_STEPS * mean) < 0.5:
        return seconds, ""
    last = np.append(steps >= _BURST_STEPS * mean, True)  # of a burst, whose readings end at its stamp
    ends = np.flatnonzero(last)
    known = np.append(0, ends[ends > 0])
    even: Floats = np.interp(np.arange(len(seconds)), known, seconds[known])
    return even, f"; stamps come in bursts of {len(seconds) / len(ends):.1f}, spread evenly"


def _stream(path: Path, streams: Sequence[Stream], topic: str | None) -> Stream:
    if topic is not None:
        matching = [stream for stream in streams if stream.name == topic]
    else:
        matching = [s for s in streams if s.type == "table" or s.type.replace("/msg/", "/") == _IMU_TYPE]
    if len(matching) == 1:
        return matching[0]
    there = ", ".join(f"{cut(s.name)} ({s.type})" for s in streams)
    expected = f"topic {cut(topic)}" if topic is not None else f"one topic of {_IMU_TYPE}, or one table"
    raise InputError(f"{path}: expected {expected}, got {len(matching)}; it has {there}")


def _named(stream: Stream, patterns: Sequence[str], *, required: bool) -> list[str]:
    plain = {_plain(name): name for name in stream.columns}
    for pattern in patterns:
        names = [plain.get(pattern.format(axis)) for axis in "xyz"]
        if all(names):
            return [name for name in names if name is not None]
    if not required:
        return []
    why = "no columns of an accelerometer such as ax, ay, az: name them with --columns"
    if any(pattern.format("x") in plain for pattern in _STRIPPED):
        why = "accelerations without gravity: record the accelerometer's own, raw"
    raise InputError(f"{stream.name}: {why}; it has {listed(list(stream.columns))}")


def _plain(name: str) -> str:
    """Return a name without its unit, in lower case, without what separates words; of "67:accelX" the end."""
    return re.sub(r"[\s_.-]", "", _UNIT.sub("", name.strip()).rpartition(":")[2].lower())


def _scale(name: str, patterns: Sequence[str]) -> float:
    """Return the factor of a column to SI, by the unit in its name."""
    match = _UNIT.search(name.strip())
    if match is None:
        return 1.0
    text = (match["unit"] or match["tail"]).lower().replace(" ", "")
    unit = WORDS["inertial"]["spelt"].get(text, text)
    choices = RATE_UNITS if patterns is _RATE else ACCELERATION_UNITS
    if unit not in choices:
        raise InputError(f'column "{cut(name)}": unit "{text}": expected one of {", ".join(choices)}; or say --units')
    return choices[unit]
