"""The report of a run of the control loop: timing, tracking, trust; and measures of a controller at work.

The two measures of A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot",
ICRA 2014: RMS of desired minus sensed joint position, and RMS of the PD term over RMS of the whole torque, near 0 %
when the model is right and beyond 100 % when the PD fights it.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.control.realtime import Durations, Timing
from catenary.plant import Jointed
from catenary.sensing.gravity_vector import GravityReading, ReadingStatus
from catenary.sensing.imu_faults import Fault
from catenary.tables import OnScreen, Screen, Table
from catenary.units import DISPLAY, TORQUE_UNIT, shown_rows


@dataclass(frozen=True)
class GravityReport:
    """Statistics of measured gravity during a run."""

    ticks: Mapping[str, int]  # of each status that occurred: nominal, live, stale, fallback, stop
    faults: Mapping[str, int]  # name of each fault that showed, and ticks in which it did
    messages: tuple[str, ...]  # what each of them means, in the same order
    largest_age: float  # [s] of a measured vector; NaN when none was measured

    def __str__(self) -> str:
        lines = ["gravity: " + ", ".join(f"{name} {count} ticks" for name, count in self.ticks.items())]
        lines += [
            f"gravity: {name} in {count} ticks: {message}"
            for (name, count), message in zip(self.faults.items(), self.messages, strict=True)
        ]
        return "\n".join(lines)


@dataclass(frozen=True, repr=False)
class LoopReport(OnScreen):
    """Timing, trust and tracking of one run; per joint in the robot's order."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    rate_hz: float
    ticks: int
    finished: bool  # false when an error or Ctrl-C ended it
    compute: Timing | None  # [s] of a tick: measuring, correcting, controlling, sending, observing
    jitter: Timing | None  # [s] by which periods differed from the nominal one; None when not in real time
    overruns: int | None  # ticks that were not done by their deadline; None when not in real time
    has_priority: bool  # real-time priority was granted
    outside_valid_range: tuple[float, ...] | None  # share of ticks, per joint; None without corrector
    tracking_nominal: tuple[float, ...]  # RMS of reference - q_nominal [rad|m]; NaN where never measured
    # RMS of reference - q_calibrated [rad|m]; None without corrector
    tracking_calibrated: tuple[float, ...] | None
    limited_ticks: int  # in which the limits changed a torque
    not_finite_ticks: int  # in which a torque or position was NaN or infinite, and no torque sent for it
    gravity: GravityReport | None = None  # None without a source of gravity
    correction: Timing | None = None  # [s] of the corrector in a tick; None without one
    # [s] the longest time between two torques, or positions, that were sent; None when not in real time
    longest_gap: float | None = None

    @property
    def screen(self) -> Screen:
        """Tracking errors per joint."""
        head, *lines = str(self).splitlines()
        columns = ("joint", "unit", ("RMS error", ":.3f"), ("calibrated", ":.3f"))
        calibrated = self.tracking_calibrated or [float("nan")] * len(self.joint_names)
        table = Table(columns, shown_rows(self, self.tracking_nominal, calibrated))
        return Screen(head, [table], "; ".join(line for line in lines if "tracking error" not in line))

    def __str__(self) -> str:
        lines = [f"{self.ticks} ticks at {self.rate_hz:g} Hz" + ("" if self.finished else ", not finished")]
        for name, timing in (("whole tick, robot included", self.compute), ("period jitter", self.jitter)):
            if timing is not None:
                values = zip(("median", "p99", "p99.9", "max"), timing, strict=True)
                lines.append(f"{name} [us]: " + ", ".join(f"{key} {1e6 * v:.4g}" for key, v in values))
        if self.overruns is not None:
            lines.append(f"overruns: {self.overruns}; real-time priority: {'yes' if self.has_priority else 'no'}")
        if self.longest_gap is not None:
            lines.append(f"longest time between two commands: {1e3 * self.longest_gap:.4g} ms")
        for j, (name, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True)):
            line = f"{name}: tracking error {self.tracking_nominal[j]:.4g} {unit} RMS"
            if self.tracking_calibrated is not None and self.outside_valid_range is not None:
                line += f", calibrated {self.tracking_calibrated[j]:.4g} {unit}"
                line += f"; outside the valid range {100.0 * self.outside_valid_range[j]:.3g} % of ticks"
            lines.append(line)
        if self.gravity is not None:
            lines.append(str(self.gravity))
        return "\n".join(lines)


class GravityTally:
    """Counts what a source of gravity says over the ticks of a run."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[ReadingStatus, Fault]] = Counter()
        self._largest_age = float("nan")

    def add(self, reading: GravityReading) -> None:
        """Count a tick."""
        self._counts[reading.status, reading.faults] += 1
        if isfinite(reading.age) and not reading.age <= self._largest_age:
            self._largest_age = reading.age

    def report(self) -> GravityReport:
        """Return the report of what was counted."""
        ticks, faults = Counter[str](), Counter[Fault]()
        for (status, shown), count in self._counts.items():
            ticks[status.value] += count
            faults.update(dict.fromkeys(shown, count))
        return GravityReport(
            ticks=ticks,
            faults={fault.names[0]: count for fault, count in faults.items()},
            messages=tuple(fault.message for fault in faults),
            largest_age=self._largest_age,
        )


class LoopTally:
    """Sums over the ticks of a run of n joints, for its report."""

    def __init__(self, n: int, *, sensed: bool) -> None:
        self.ticks, self.compute = 0, Durations()
        # of the reference less reported and calibrated positions, where that is a number
        self._squares, self._counts = np.zeros((2, n)), np.zeros((2, n))
        self.outside = np.zeros(n)  # ticks of each joint beyond the corrector's valid range
        self.gravity = GravityTally() if sensed else None

    def add(self, reference: Floats, q_nominal: Floats, q: Floats, inside: Flags) -> None:
        """Count a tick: reference, reported and calibrated positions [rad|m], and whether each is inside, (n,)."""
        error = reference - np.array([q_nominal, q])
        known = np.isfinite(error)
        np.add(self._squares, error * error, out=self._squares, where=known)
        self._counts += known
        self.outside += ~inside
        self.ticks += 1

    def tracking(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return RMS errors (n,) of reported and calibrated positions [rad|m]; NaN if there never was a number."""
        with np.errstate(invalid="ignore"):
            reported, calibrated = np.sqrt(self._squares / self._counts).tolist()
        return tuple(reported), tuple(calibrated)


@dataclass(frozen=True)
class Tracking:
    """Tracking of a motion by a controller, tick by tick and in sum; joints in the robot's order."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    time: Floats  # (T,) [s] since the motion began
    error: Floats  # (T, n) desired minus sensed position [rad|m]
    feedback: Floats  # (T, n) PD term [Nm|N]
    torque: Floats  # (T, n) as sent [Nm|N]
    counted: Floats  # (T,) 1 on the ticks that the measures are of, else 0
    loop: LoopReport

    @property
    def rms_error(self) -> Floats:
        """RMS of the joint errors over the ticks that count, (n,) [rad|m]."""
        return self._rms(self.error)

    @property
    def pd_share(self) -> Floats:
        """RMS of the PD term over RMS of the torque, (n,); 0.1 is 10 %. NaN if no torque was sent at all."""
        return pd_share(self.rms_feedback, self.rms_torque)

    @property
    def rms_feedback(self) -> Floats:
        """RMS of the PD term, (n,) [Nm|N]."""
        return self._rms(self.feedback)

    @property
    def rms_torque(self) -> Floats:
        """RMS of the torque, (n,) [Nm|N]."""
        return self._rms(self.torque)

    def _rms(self, rows: Floats) -> Floats:
        kept = rows[self.counted > 0.0]
        return np.sqrt(np.mean(kept**2, axis=0))

    def as_data(self) -> dict[str, Any]:
        """Plain data: errors in deg and mm, torques in Nm and N, shares in percent."""
        torques = {
            "rms_pd": self.rms_feedback,
            "rms_torque": self.rms_torque,
            "pd_share_percent": 100.0 * self.pd_share,
        }
        units = {"torque_unit": [TORQUE_UNIT[unit] for unit in self.joint_units]}
        return {
            "simulated": True,
            "seconds": float(self.counted.sum()) / self.loop.rate_hz,
            "joints": _per_joint(self, {"rms_error": self.rms_error * _scale(self)} | units | torques),
            "limited_ticks": self.loop.limited_ticks,
            "not_finite_ticks": self.loop.not_finite_ticks,
            **_known(self.gravity),
        }

    @property
    def gravity(self) -> GravityReport | None:
        """How gravity was known, the way to the motion's start included; None without a source of it."""
        return self.loop.gravity


def pd_share(rms_feedback: Floats, rms_torque: Floats) -> Floats:
    """RMS of the PD term over RMS of the torque; NaN if there is no torque."""
    return np.divide(rms_feedback, rms_torque, out=np.full_like(rms_torque, np.nan), where=rms_torque > 0.0)


def _scale(joints: Jointed) -> Floats:
    return np.array([DISPLAY[unit][1] for unit in joints.joint_units])


def _per_joint(joints: Jointed, columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return each joint's name, its unit as shown, and its entries of columns (n,), as plain data."""
    shown = [DISPLAY[unit][0] for unit in joints.joint_units]
    rows = zip(joints.joint_names, shown, *(np.asarray(column).tolist() for column in columns.values()), strict=True)
    return [dict(zip(("name", "unit", *columns), row, strict=True)) for row in rows]


def _known(gravity: GravityReport | None) -> dict[str, Any]:
    """Return as plain data how gravity was known; nothing without a source of it."""
    return {} if gravity is None else {"gravity_ticks": dict(gravity.ticks), "faults": dict(gravity.faults)}


@dataclass(frozen=True)
class Holding:
    """Drift of an arm that is held only by gravity compensation."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    time: Floats  # (T,) [s]
    q: Floats  # (T, n) as reported, at the motors [rad|m]
    q_true: Floats  # (T, n) where the joints really were
    gravity: GravityReport | None = None  # how it was known; None without a source of it

    @property
    def drift(self) -> Floats:
        """Largest distance of each joint from its start (n,) [rad|m], by true positions."""
        return np.abs(self.q_true - self.q_true[0]).max(axis=0)

    def as_data(self) -> dict[str, Any]:
        """Plain data in deg and mm."""
        reported, off = (np.abs(self.q - place).max(axis=0) for place in (self.q[0], self.q_true))
        moved = {"reported_drift": reported, "reported_off": off, "moved": self.q_true[-1] - self.q_true[0]}
        joints = _per_joint(self, {key: x * _scale(self) for key, x in ({"drift": self.drift} | moved).items()})
        return {"simulated": True, "seconds": float(self.time[-1]), "joints": joints, **_known(self.gravity)}
