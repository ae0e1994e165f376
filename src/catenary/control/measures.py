"""Measures of a controller at work: tracking error, share of the PD term, drift of what is held.

The two measures of A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot",
ICRA 2014: RMS of desired minus sensed joint position, and RMS of the PD term over RMS of the whole torque, near 0 %
when the model is right and beyond 100 % when the PD fights it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.control.report import GravityReport, LoopReport
from catenary.units import DISPLAY, TORQUE_UNIT


@dataclass(frozen=True)
class Tracking:
    """What a controller did along a motion, tick by tick, and in sum; joints in the robot's order."""

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
        """RMS of the PD term over RMS of the torque, (n,); 0.1 is 10 %. NaN where no torque was sent at all."""
        return pd_share(self._rms(self.feedback), self._rms(self.torque))

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
        rms: Floats = np.sqrt(np.mean(kept**2, axis=0))
        return rms

    def as_data(self) -> dict[str, Any]:
        """Plain data: errors in deg and mm, torques in Nm and N, shares in percent."""
        joints = [
            {
                "name": name,
                "unit": DISPLAY[unit][0],
                "rms_error": float(self.rms_error[j]) * DISPLAY[unit][1],
                "torque_unit": TORQUE_UNIT[unit],
                "rms_pd": float(self.rms_feedback[j]),
                "rms_torque": float(self.rms_torque[j]),
                "pd_share_percent": 100.0 * float(self.pd_share[j]),
            }
            for j, (name, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True))
        ]
        return {
            "simulated": True,
            "seconds": float(self.counted.sum()) / self.loop.rate_hz,
            "joints": joints,
            "limited_ticks": self.loop.limited_ticks,
            "not_finite_ticks": self.loop.not_finite_ticks,
            **_known(self.gravity),
        }

    @property
    def gravity(self) -> GravityReport | None:
        """How gravity was known, the way to the motion's start included; None without a source of it."""
        return self.loop.gravity


def pd_share(rms_feedback: Floats, rms_torque: Floats) -> Floats:
    """RMS of the PD term over RMS of the torque; NaN where there is no torque."""
    return np.divide(rms_feedback, rms_torque, out=np.full_like(rms_torque, np.nan), where=rms_torque > 0.0)


def _known(gravity: GravityReport | None) -> dict[str, Any]:
    """Return as plain data how gravity was known; nothing without a source of it."""
    return {} if gravity is None else {"gravity_ticks": dict(gravity.ticks), "faults": dict(gravity.faults)}


def _farthest(q: Floats) -> Floats:
    largest: Floats = np.abs(q - q[0]).max(axis=0)
    return largest


@dataclass(frozen=True)
class Holding:
    """Where an arm went that nothing but gravity compensation held."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    time: Floats  # (T,) [s]
    q: Floats  # (T, n) as reported, at the motors [rad|m]
    q_true: Floats  # (T, n) where the joints really were
    gravity: GravityReport | None = None  # how it was known; None without a source of it

    @property
    def drift(self) -> Floats:
        """How far each joint was from where it began, at most, (n,) [rad|m], true positions."""
        return _farthest(self.q_true)

    @property
    def reported_drift(self) -> Floats:
        """The same of the positions that the robot reports."""
        return _farthest(self.q)

    def as_data(self) -> dict[str, Any]:
        """Plain data in deg and mm."""
        scale = np.array([DISPLAY[unit][1] for unit in self.joint_units])
        columns = self.drift * scale, self.reported_drift * scale, (self.q_true[-1] - self.q_true[0]) * scale
        return {
            "simulated": True,
            "seconds": float(self.time[-1]),
            "joints": [
                {
                    "name": name,
                    "unit": DISPLAY[unit][0],
                    "drift": float(columns[0][j]),
                    "reported_drift": float(columns[1][j]),
                    "moved": float(columns[2][j]),
                }
                for j, (name, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True))
            ],
            **_known(self.gravity),
        }
