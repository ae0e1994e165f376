"""An inertial unit's readings out of a recording: a bag with sensor_msgs/Imu, or a table with columns for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.columns import Stream, places_of
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.table_time import time_of

IMU = "sensor_msgs/Imu"
# names of x, y, z as drivers and people write them, in lower case; {} is the axis
_FORCE = ("linear_acceleration.{}", "a{}", "acc_{}", "accel_{}", "acceleration_{}", "accelerometer_{}", "f{}")
_RATE = ("angular_velocity.{}", "g{}", "w{}", "gyro_{}", "rate_{}", "gyroscope_{}", "angular_velocity_{}")
_LEAST = 10  # readings


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
    path: Path, *, topic: str | None = None, columns: Sequence[str] = (), time_unit: str | None = None
) -> ImuRecording:
    """Read the readings of an inertial unit.

    Args:
        path: A bag (.bag, .mcap, .db3), or a table (.csv, .parquet, .npz, .mat) with a column of time.
        topic: Of a bag with several Imu topics.
        columns: Of a table: three of the accelerometer, and three of the gyroscope if any; told by their names without.
        time_unit: Of a table's time; told by its name or its steps when None.
    """
    sources = Sources([path])
    stream = _stream(path, sources.streams, topic)
    names = [place.column for name in columns for place in places_of(name, [stream])]
    if names and len(names) not in (3, 6):
        raise InputError(f"columns: expected three of the accelerometer and three of the gyroscope, got {len(names)}")
    names = names or _named(stream, _FORCE, required=True) + _named(stream, _RATE, required=False)
    whole = sources.read({stream.name: names}).get(stream.name, stream)
    if whole.type == "table":
        told = time_of(stream, (), time_unit, None)
        if told is None:
            raise InputError(f"{path}: no column of time, such as time or t_us; it has {_shown(stream)}")
        stamp, why = told.stamp, told.said
    else:
        given = whole.stamp if whole.stamp is not None and (whole.stamp > 0).all() else whole.arrival
        if given is None:
            raise FileFormatError(f"{path}: {stream.name}: its messages have no stamps")
        stamp, why = given, f"{stream.name}: {whole.rows} messages"
    values = np.column_stack([np.asarray(whole.columns[name], dtype=float) for name in names])
    known = stamp > np.iinfo(np.int64).min
    if known.sum() < _LEAST:
        raise FileFormatError(f"{path}: expected at least {_LEAST} readings with a time, got {int(known.sum())}")
    seconds = (stamp[known] - stamp[known][0]) / 1e9
    rows = values[known]
    rate = rows[:, 3:] if rows.shape[1] == 6 else None
    said = (why, f"read {', '.join(map(cut, names))}")
    return ImuRecording(seconds, rows[:, :3], rate, (*said, *sources.notes))


def _stream(path: Path, streams: Sequence[Stream], topic: str | None) -> Stream:
    if topic is not None:
        found = [stream for stream in streams if stream.name == topic]
    else:
        found = [s for s in streams if s.type == "table" or s.type.replace("/msg/", "/") == IMU]
    if len(found) == 1:
        return found[0]
    there = ", ".join(f"{cut(s.name)} ({s.type})" for s in streams)
    wanted = f"topic {cut(topic)}" if topic is not None else f"one topic of {IMU}, or one table"
    raise InputError(f"{path}: expected {wanted}, got {len(found)}; it has {there}")


def _named(stream: Stream, patterns: Sequence[str], *, required: bool) -> list[str]:
    lower = {name.lower(): name for name in stream.columns}
    for pattern in patterns:
        names = [lower.get(pattern.format(axis)) for axis in "xyz"]
        if all(names):
            return [name for name in names if name is not None]
    if not required:
        return []
    raise InputError(
        f"{stream.name}: no columns of an accelerometer such as ax, ay, az; it has {_shown(stream)}; "
        "name them with --columns"
    )


def _shown(stream: Stream) -> str:
    return ", ".join(cut(name) for name in list(stream.columns)[:12])
