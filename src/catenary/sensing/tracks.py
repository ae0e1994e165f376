"""What the readings of an accelerometer and a gyroscope come to: those that are believed, through a filter each."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.agreement import TURNTABLE_SHARE
from catenary.sensing.checks import Fault, GravityCheck, RateCheck, RawCheck, SensorRules, norm
from catenary.sensing.delay_free_filter import DelayFreeFilter
from catenary.sensing.gyro_prediction import RestRate
from catenary.sensing.mounting import Mounting
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross

_RECENT_S = 0.2  # in which gravity's own change tells turning, where no gyroscope does
_NEW_MOTION_AFTER_S = 0.5  # between samples, after which gravity's change is another motion's
_NOISE_AVERAGE_S = 0.02  # over which noise averages out of what readings are ahead of the filter
_BEGINNING_S = 0.04  # in which a base may have begun to turn as fast as gravity shows
_SLOPE_PER_VALUE = 16.0  # by which a filter's slope is off where its value is behind, times the window
_NOISY_SWING = 2.0  # [rad/s2] of angular acceleration that noise may be
_UNCHECKED_TURN = 0.1  # [rad] about the vertical, by rates that nothing else can check, while gravity stands still
_SLOW_RATE = 0.05  # [rad/s] that bias and noise may be of it


class GravityTrack:
    """Gravity at the sensor by an accelerometer (3,) [m/s2], and how far it may be off by what is not known yet."""

    def __init__(self, rules: SensorRules, mounting: Mounting, cutoff_hz: float) -> None:
        faults = Fault.NOT_FINITE, Fault.STUCK, Fault.SATURATED
        self.raw, self.check = RawCheck(rules, mounting.acceleration_range, faults), GravityCheck(rules)
        self.filter, self.gaps = DelayFreeFilter(cutoff_hz), 0  # after which its parabola began anew
        self._rest_spread, self._lever = rules.rest_spread, norm(mounting.position)
        self._ahead = np.zeros(3)  # of the filter: readings of late
        self._recent, self._changed = LEVEL, 0.0  # gravity of late, and how far it has moved from there
        self.sudden = 0.0  # [m/s2] that the lever may have made, of the newest reading

    @property
    def horizon(self) -> float:
        """Time beyond the newest sample for which a parabola is followed [s]; further it would run away."""
        return 0.6 * self.filter.window

    @property
    def is_ahead(self) -> bool:
        """The readings of late are ahead of the filter."""
        return norm(self._ahead) > 0.8 * self._rest_spread

    def at(self, time: float) -> Floats:
        """Return gravity (3,) at a time [s], followed to the horizon."""
        return np.asarray(self.filter.at(min(time, self.filter.newest + self.horizon))[0])

    def meet_anew(self) -> None:
        """Forget the readings before."""
        self.check.forget()
        self.filter.clear()

    def fault(self, stamp: float, gravity: Floats, rate: Floats | None, swing: float) -> Fault:
        """Return the fault of a reading on a base that turns at a rate (3,) and swings by `swing` [rad/s2]."""
        expected = self.at(stamp)
        sudden = norm(gravity - expected) - self._rest_spread
        self.sudden = max(0.0, min(sudden, self._lever * GravityCheck.JERKY))
        return self.check.fault(stamp, gravity, expected, rate, swing)

    def add(self, stamp: float, gravity: Floats) -> None:
        """Take a believed reading."""
        dt = stamp - self.filter.newest
        if dt > 0.5 * self.filter.window:
            self.filter.clear()  # a parabola over a gap would be a guess
            self.gaps += 1
        self.filter.add(stamp, gravity)
        now = self.filter.at(stamp)[0]
        self._ahead = self._ahead + (1.0 - math.exp(-dt / _NOISE_AVERAGE_S)) * (gravity - now - self._ahead)
        moved = now - self._recent
        self._recent = self._recent + (1.0 - math.exp(-dt / _RECENT_S)) * moved
        # a lever and a turn may undo each other for a moment
        last = self._changed * math.exp(-dt / (2.0 * _RECENT_S))
        self._changed = max(norm(moved), last) if dt < _NEW_MOTION_AFTER_S else 0.0

    def turning_doubt(self) -> float:
        """Return how far gravity may be off by turns that no gyroscope tells [m/s2]."""
        # what moved it may be the lever alone, as of a turn about the vertical, or a turn with what it does to that
        own = self._changed / (STANDARD_GRAVITY * _RECENT_S)
        return min(1.25 * self._changed, self._lever * (own * own + own / _BEGINNING_S))


class RateTrack:
    """Angular rate by a gyroscope (3,) [rad/s], its bias at rest taken off, and its derivative."""

    def __init__(self, rules: SensorRules, mounting: Mounting, cutoff_hz: float) -> None:
        faults = Fault.RATE_NOT_FINITE, Fault.RATE_STUCK, Fault.RATE_SATURATED
        self.raw, self.check = RawCheck(rules, mounting.rate_range, faults), RateCheck(rules)
        self.rest, self.filter = RestRate(rules.still_rate), DelayFreeFilter(cutoff_hz)
        self._ahead = np.zeros(3)  # of the filter: rates of late
        self.slope_error = 0.0  # [rad/s2] by which its slope, angular acceleration, may be off for that
        self._about_vertical = 0.0  # [rad] turned of late

    @property
    def is_full(self) -> bool:
        """There are enough rates for a derivative."""
        return self.filter.span >= 0.6 * self.filter.window

    @property
    def is_unopposed(self) -> bool:
        """The base turned about the vertical alone, by which gravity stays where it is."""
        return self._about_vertical > _UNCHECKED_TURN

    def swing(self, time: float) -> float:
        """Return how fast the turning may change at a time [s], beyond noise [rad/s2]."""
        return max(0.0, norm(self.filter.at(time)[1]) + self.slope_error - _NOISY_SWING)

    def begin_anew_after(self, dt: float) -> None:
        """Forget rates before a gap of dt [s], if it is one."""
        if dt > 0.5 * self.filter.window:
            self.filter.clear()

    def watch_vertical(self, rate: Floats, dt: float, down: Floats | None, *, steady: bool) -> None:
        """Count turning about the vertical, `down` (3,) as last believed, over dt [s] while gravity is steady."""
        fast = norm(rate)
        upright = down is not None and norm(cross(down, rate)) < TURNTABLE_SHARE * fast * norm(down)
        if not steady or (not upright and fast > _SLOW_RATE):
            self._about_vertical = 0.0
        elif upright:
            self._about_vertical += dt * fast

    def add(self, stamp: float, rate: Floats, dt: float) -> None:
        """Take a believed rate, dt [s] after the last."""
        self.filter.add(stamp, rate)
        share = 1.0 - math.exp(-10.0 * dt / self.filter.window)
        self._ahead = self._ahead + share * (rate - self.filter.at(stamp)[0] - self._ahead)
        self.slope_error = _SLOPE_PER_VALUE * norm(self._ahead) / self.filter.window
