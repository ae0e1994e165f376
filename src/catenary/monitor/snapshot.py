"""A robot at one instant, and what of it deserves a warning."""

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.plant import OperatingState

NEAR_LIMIT = {"rad": np.deg2rad(2.0), "m": 0.005}  # from a limit
STALE_GRAVITY = 0.1  # [s], as old as the gravity estimator lets a reading be before it calls it stale
WINDOW = 1.0  # [s] over which rates are counted


class Snapshot(NamedTuple):
    """A robot at one instant; None for what is not known."""

    time: float  # [s] of the robot
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    q: Floats  # (n,) [rad|m] reported
    setpoint: Floats | None = None
    calibrated: Floats | None = None
    inside: NDArray[np.bool_] | None = None  # (n,) inside the model's valid range
    interval: Floats | None = None  # (n,) half-width about `calibrated` [rad|m]; NaN for a joint without
    encoder: Floats | None = None  # (n,) external encoders, or a recording's truth; NaN: none
    tau: Floats | None = None  # (n,) [Nm|N]
    gravity_tau: Floats | None = None  # (k,) what holds the first k joints still [Nm|N]
    gravity: Floats | None = None  # (3,) [m/s2] in the base frame
    gravity_age: float = np.inf  # [s]; inf: nominal
    operating: OperatingState | None = None
    fault: str = ""  # why the robot is in FAULT; empty where it does not say
    lower: Floats | None = None
    upper: Floats | None = None
    rate_hz: float | None = None  # at which states come
    late: int = 0  # ticks late within the last second
    silent: str | None = None  # the error that the robot's silence raised
    recording: str | None = None  # state of a recording made at the same time
    error: Floats | None = (
        None  # (k,) reported less true position of the first k joints; None but in a simulation
    )
    tip: Floats | None = None  # (3,) [m] in the base frame, by reported joints
    tip_error: float | None = None  # [m] from where the tip really is; None but in a simulation
    tip_from_encoders: float | None = None  # [m] from where external encoders say that it is
    calibrated_from_encoders: float | None = None  # [m] the same, by calibrated joints

    def warnings(self) -> list[str]:
        """Return what deserves a warning, the worst first."""
        found: list[str] = []
        if self.silent is not None:
            found.append(f"stale: {self.silent}")
        if self.operating is not None:
            if self.operating.state == "FAULT":
                found.append(f"the robot is in FAULT: {self.fault or 'it does not say why'}")
            if not self.operating.is_homed and not self.operating.is_busy:
                found.append("not homed: joint positions mean nothing")
        if np.isfinite(self.gravity_age) and self.gravity_age > STALE_GRAVITY:
            found.append(f"gravity is {self.gravity_age:.2f} s old")
        if self.inside is not None and not self.inside.all():
            names = [name for name, ok in zip(self.joint_names, self.inside, strict=True) if not ok]
            found.append(f"outside the model's valid range: {', '.join(names)}")
        near = self._near_limits()
        if near:
            found.append(f"near a limit: {', '.join(near)}")
        if self.late:
            found.append(f"{self.late} ticks of this program late within {WINDOW:g} s")
        return found

    def _near_limits(self) -> list[str]:
        if self.lower is None or self.upper is None:
            return []
        margin = np.array([NEAR_LIMIT[unit] for unit in self.joint_units])
        near = (self.q < self.lower + margin) | (self.q > self.upper - margin)
        return [name for name, bad in zip(self.joint_names, near, strict=True) if bad]

    def as_data(self) -> dict[str, Any]:
        """Return plain data, SI; null for what is not known."""
        return {
            "time": self.time,
            "joints": self.joint_names,
            "units": self.joint_units,
            "q": self.q,
            "setpoint": self.setpoint,
            "q_calibrated": self.calibrated,
            "q_interval": self.interval,
            "inside_valid_range": self.inside,
            "q_encoder": self.encoder,
            "tau": self.tau,
            "gravity_torque": self.gravity_tau,
            "gravity": self.gravity,
            "gravity_age_s": self.gravity_age,
            "state": None if self.operating is None else self.operating._asdict(),
            "fault": self.fault or None,
            "rate_hz": self.rate_hz,
            "late_ticks": self.late,
            "recording": self.recording,
            "true_error": self.error,
            "tip": self.tip,
            "tip_error": self.tip_error,
            "tip_from_encoders": self.tip_from_encoders,
            "calibrated_tip_from_encoders": self.calibrated_from_encoders,
            "warnings": self.warnings(),
        }


class EventRate:
    """Counts events, and their mean rate, over the last second."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def count(self, now: float, times: int = 1) -> None:
        """Count events at a time [s]."""
        self._times.extend([now] * times)
        self._drop(now)

    def within(self, now: float) -> int:
        """Return the number of events within the last second."""
        self._drop(now)
        return len(self._times)

    def hertz(self, now: float) -> float | None:
        """Return the mean rate [Hz]; None before two events."""
        self._drop(now)
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])

    def _drop(self, now: float) -> None:
        while self._times and self._times[0] < now - WINDOW:
            self._times.popleft()
