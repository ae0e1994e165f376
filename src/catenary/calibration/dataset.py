"""Rows to learn from: features, where the joints were said to be, and how far off that was."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Flags, Floats, Integers, spread
from catenary.calibration.features import FeatureSet
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.parallel import Progress, of_each
from catenary.plant import FIRST_DATE_S, Jointed, MotionLog, joints_text

_LAST_DATE_S = 1e10  # [s since 1970]
_ROWS = ("X", "q_nominal", "error", "leaping", "position", "time")  # arrays that have a row for each usable one


@dataclass(frozen=True)
class TrainingSource:
    """A recording that training rows were taken from, with what was left out."""

    name: str
    sha256: str | None
    rows: int  # in the recording, of those that were asked for
    without_truth: int  # rows whose `ok` is not set
    dropped: int  # rows beyond the error limit that was asked for
    simulated: bool
    leaps: Mapping[str, int] = field(default_factory=dict)  # by signal, those that play states did not follow
    beyond: Mapping[str, int] = field(default_factory=dict)  # by joint, rows dropped for its error
    marks: tuple[str, ...] = ()  # hashes of some rows, as of `MotionLog.marks`
    poses: tuple[tuple[float, ...], ...] = ()  # as of `MotionLog.poses`


@dataclass(frozen=True)
class CalibrationData:
    """N usable rows of one or more recordings, in order."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    features: FeatureSet
    X: Floats  # (N, F)
    q_nominal: Floats  # (N, n)
    error: Floats  # (N, n) q_encoder - q_nominal [rad|m]: what a model must add
    leaping: Flags  # (N,) rows that leap; see FeatureRows
    recording: Integers  # (N,) index into `sources`
    position: Floats  # (N,) how far into its recording the row lies, 0 to 1
    time: Floats  # (N,) [s], or the row number where a recording has no time
    sources: tuple[TrainingSource, ...]
    has_time: bool
    robot: str | None = None
    every: int = 1  # of so many rows one is among these or was left out
    began: tuple[float, ...] = ()  # [s] of each source: what its own clock said at its time zero

    def __len__(self) -> int:
        return len(self.X)

    @property
    def dates(self) -> tuple[str | None, str | None]:
        """Days of the first and the last row (ISO 8601, UTC); None if no clock was a calendar's."""
        if not self.has_time or not len(self):
            return None, None
        clock = self.time + np.array(self.began)[self.recording]
        return date_of(float(clock[0])), date_of(float(clock.max()))

    def require(self, joints: Jointed, features: FeatureSet) -> None:
        """Refuse rows of other joints than a model's, or in another order, and with other features than it takes."""
        if (self.joint_names, self.joint_units) != (joints.joint_names, joints.joint_units):
            raise InputError(f"data: has joints {joints_text(self)}; the model is for {joints_text(joints)}")
        if self.features != features:
            taken = f"the model takes {', '.join(features.names)}"
            raise InputError(f"data: holds {', '.join(self.features.names)}; {taken}")

    def rows(self, mask: Flags) -> "CalibrationData":
        """Return the rows where `mask` (N,) is set."""
        return replace(self, **{name: getattr(self, name)[mask] for name in (*_ROWS, "recording")})

    def split_by_time(self, held_out: float) -> tuple["CalibrationData", "CalibrationData"]:
        """Return the first part of every recording and its last, whose share is `held_out`."""
        if not 0.0 < held_out < 1.0:
            raise InputError(f"held-out share: expected a number between 0 and 1, got {held_out}")
        late = self.position >= 1.0 - held_out
        if late.all() or not late.any():
            raise InputError(f"held-out share {held_out}: leaves no rows on one side of {len(self)}")
        return self.rows(~late), self.rows(late)

    def blocks(self, count: int) -> Integers:
        """Return each row's block of `count`, (N,): parts of its recording."""
        block = np.zeros(len(self), dtype=np.int64)
        for number in range(len(self.sources)):
            rows = np.flatnonzero(self.recording == number)
            block[rows] = np.arange(len(rows)) * count // max(1, len(rows))
        return block


def date_of(seconds: float) -> str | None:
    """Return the day (ISO 8601, UTC) of a clock that counts from 1970; None if it does not show the date."""
    return datetime.fromtimestamp(seconds, UTC).date().isoformat() if FIRST_DATE_S < seconds < _LAST_DATE_S else None


def calibration_data(
    logs: Sequence[MotionLog], features: FeatureSet, *, max_error: Floats | None = None, every: int = 1
) -> CalibrationData:
    """Collect the usable rows of recordings of one robot with errors within limits (n,) [rad|m]; see `usable_rows`."""
    return usable_rows(replace(Recordings.of(logs), max_error=max_error), features, every=every)


def usable_rows(recordings: Recordings, features: FeatureSet, *, every: int = 1) -> CalibrationData:
    """Collect the rows of recordings that have a measurement (`ok`), and no error beyond the recordings' limits.

    Args:
        features: Features to compute; they follow all rows.
        every: One row in so many is taken, at random.
    """
    logs = recordings.logs
    has_time = all(log.time is not None for log in logs)
    work = partial(_usable_rows, features=features, max_error=recordings.max_error, every=every, has_time=has_time)
    parts, sources = zip(*of_each(work, logs), strict=True)
    rows: dict[str, Any] = dict(zip(_ROWS, map(np.concatenate, zip(*parts, strict=True)), strict=True))
    recording = np.repeat(np.arange(len(logs)), [len(part[0]) for part in parts])
    robot, began = next((log.robot for log in logs if log.robot is not None), None), tuple(log.began for log in logs)
    data = CalibrationData(
        logs[0].joint_names, logs[0].joint_units, features, **rows,
        recording=recording, sources=sources, has_time=has_time, robot=robot, every=every, began=began,
    )  # fmt: skip
    if not len(data):
        what = "rows, {0.without_truth} without measurement, {0.dropped} beyond the error limit)"
        named = "; ".join(f'"{{0.name}}" ({{0.rows}} {what}'.format(source) for source in sources)
        raise InputError(f"data: no usable row in {named}")
    return data


def _usable_rows(
    log: MotionLog, _: Progress, *, features: FeatureSet, max_error: Floats | None, every: int, has_time: bool
) -> tuple[tuple[NDArray[Any], ...], TrainingSource]:
    """Return X, q_nominal, error, leaping, position and time of a recording's usable rows, and what was left out."""
    if log.q_encoder is None:
        raise InputError(f'recording "{log.name}": has no q_encoder; a calibration needs measured joint positions')
    index = spread(len(log), -(-len(log) // every))
    X, leaping, spikes = features.rows(log, None if every == 1 else index)
    q, ok = log.q_nominal[index], log.ok[index]
    error = log.q_encoder[index] - q
    far = np.zeros(error.shape, dtype=bool)
    if max_error is not None:
        far[ok] = np.abs(error[ok]) > max_error
    inside = ~far.any(axis=1)
    source = TrainingSource(
        name=log.name,
        **log.identity,
        rows=len(q),
        without_truth=int((~ok).sum()),
        dropped=int((ok & ~inside).sum()),
        simulated=log.simulated,
        leaps={name: count for name, count in spikes.items() if count},
        beyond={n: int(k) for n, k in zip(log.joint_names, far.sum(axis=0), strict=True) if k},
    )
    time = log.time[index] if has_time and log.time is not None else index.astype(np.float64)
    return tuple(column[ok & inside] for column in (X, q, error, leaping, index / len(log), time)), source


def data_notes(logs: Sequence[MotionLog], data: CalibrationData) -> list[str]:
    """Return the notes of a recording's readers, and notes on rows that were left out.

    Args:
        logs, data: Recordings, and the rows that were taken of them.
    """
    notes = [note for log in logs for note in log.named_notes]
    if data.every > 1:
        count = sum(len(log) for log in logs)
        notes.append(f"of {count:,} rows one in {data.every} is learnt from; memory follows them all")
    for source in data.sources:
        beyond, leaps = (
            ", ".join(map("{0[0]} {0[1]}".format, counts.items())) for counts in (source.beyond, source.leaps)
        )
        beyond = f"beyond the error limit ({beyond})"
        left_out = {"without measurement": source.without_truth, beyond: source.dropped}
        if text := ", ".join(f"{count} {why}" for why, count in left_out.items() if count):
            notes.append(f"{source.name}: left out {text}, of {source.rows} rows")
        if source.leaps:
            notes.append(f"{source.name}: play states did not follow leaps of {leaps}")
    return notes
