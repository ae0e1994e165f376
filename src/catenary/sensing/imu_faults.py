"""Fault detection of accelerometer and gyroscope samples: raw readings, gravity's plausibility, angular rates."""

import math
import tomllib
from enum import Flag, auto
from functools import cache
from importlib.resources import files

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.platforms import BaseSpectrum
from catenary.spatial import STANDARD_GRAVITY, cross

Vector = tuple[float, float, float]
_MAX_RATE = 20.0  # [rad/s] faster than any base turns
_MAX_RATE_STEP = 0.5  # [rad/s] between a rate and its prediction from earlier ones
_FUTURE_S = 0.005  # [s] tolerance of stamps ahead of the reader's clock
_CONFIRM_READINGS = 5  # consecutive good readings before a sensor is accepted, at first or after a fault
_ACCEPT_JUMP_S = 0.5  # [s] after which an unexplained jump is accepted
_TRUST_AGAIN_S = 10.0  # [s] of good readings after a jump that no base can make
_MAX_TILT = math.radians(120.0)  # [rad] initial tilt of a base that does not hang
_CALIBRATION = 0.8  # [m/s2] length error of a cheap sensor: 80 mg on its z axis (MPU-6050, table 6.2)
_SLOW_RESIDUAL = 0.5  # [m/s2] of slow accelerations that may remain in the mean
_MAX_ACCELERATION = 7.0  # [m/s2] of a base, beyond vibration: largest difference of a length from gravity's
_MEAN_S = 60.0  # [s] averaging time over which the accelerations of every base cancel
_EVEN_LENGTH, _SMOOTH_S = 0.06, 0.3  # [m/s2] band of a constant length, and its smoothing time [s]
# [s] longest constant acceleration of a base, and of one that heaves slowly; [m/s2] least length error that counts
_EVEN_S, _EVEN_SLOW_S, _MIN_LENGTH_ERROR = 2.5, 10.0, 0.3
_EVEN_FROM_START_S = 0.8  # [s] the same of a base that has not been at rest yet
_REST_SPREAD = 0.3  # [m/s2] largest standard deviation at rest, of the three axes together
_ROUGH_SIGMAS = 4.0  # largest step of vibration and noise, in standard deviations
_EYE = np.eye(3)
_ORDERS = [np.array(p) for p in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))]


class Fault(Flag):
    """Faults of an accelerometer or a gyroscope, which can be combined."""

    NONE = 0
    NOTHING_RECEIVED = auto()
    INTERRUPTED = auto()
    RATES_INTERRUPTED = auto()
    SAMPLES_LOST = auto()
    NOT_FINITE = auto()
    STUCK = auto()
    SATURATED = auto()
    SPIKE = auto()
    JUMP = auto()
    WRONG_SIGN = auto()
    UPSIDE_DOWN = auto()
    AXES_SWAPPED = auto()
    UNIT_G = auto()
    UNIT_CM = auto()
    GRAVITY_STRIPPED = auto()
    MAGNITUDE = auto()
    STAMP_BACKWARDS = auto()
    STAMP_REPEATED = auto()
    STAMP_FUTURE = auto()
    STAMP_OLD = auto()
    RATE_NOT_FINITE = auto()
    RATE_STUCK = auto()
    RATE_SATURATED = auto()
    RATE_SPIKE = auto()
    RATE_TOO_FAST = auto()
    RATE_CONTRADICTS = auto()
    DISAGREEMENT = auto()
    VIBRATION = auto()
    NOT_FOLLOWED = auto()
    UNCHECKED_TURN = auto()
    RECOVERING = auto()
    RATE_SIGN = auto()
    RATE_AXES = auto()
    RATE_UNIT = auto()
    RATE_SCALE = auto()
    RATE_DELAY = auto()

    @property
    def message(self) -> str:
        """Meaning and remedy, one sentence for each fault."""
        return "; ".join(_messages()[name] for name in self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """Names in lower case."""
        return tuple(str(fault.name).lower() for fault in self)


@cache
def _messages() -> dict[str, str]:
    return tomllib.loads((files("catenary.sensing") / "data/faults.toml").read_text(encoding="utf-8"))


class RawCheck:
    """Detect faults from a reading and its predecessor, in the sensor's own axes."""

    MIN_INTERVAL_S = 1e-4  # closer stamps are the same measurement, and parabolas through them would be noise
    MAX_VALUE = 1e5  # in any unit: treated as infinite

    def __init__(self, stuck_samples: int, full_range: float, faults: tuple[Fault, Fault, Fault]) -> None:
        """Set the number of identical readings of a stuck sensor, 0 for no such check; the largest reading of an axis;
        and the faults of readings that are not finite, stuck and saturated.
        """
        self._stuck_samples = stuck_samples
        # values far beyond the range are not saturation, but another unit or a spike
        self.end, self._beyond = 0.995 * full_range, 1.05 * full_range
        self._not_finite, self._stuck, self._saturated = faults
        self._newest = -math.inf
        self._last: Vector = (math.nan, math.nan, math.nan)
        self._same = 1

    def fault(self, stamp: float, vector: Vector, now: float) -> Fault:
        """Return the fault of a reading, NONE if it has none."""
        if not math.isfinite(stamp) or stamp > now + _FUTURE_S:
            return Fault.STAMP_FUTURE
        if stamp < self._newest:
            return Fault.STAMP_BACKWARDS
        if stamp - self._newest < self.MIN_INTERVAL_S:
            return Fault.STAMP_REPEATED
        x, y, z = vector
        largest = max(abs(x), abs(y), abs(z))
        if not (math.isfinite(x + y + z) and largest < self.MAX_VALUE):
            return self._not_finite
        self._newest = stamp
        self._same = self._same + 1 if vector == self._last else 1
        self._last = vector
        if self._same >= self._stuck_samples > 0:
            return self._stuck
        if self.end <= largest <= self._beyond:
            return self._saturated
        return Fault.NONE


class GravityCheck:
    """Detect readings that cannot be gravity seen from a base, or that contradict earlier ones.

    Works on free-fall acceleration in base axes. Sensor mistakes (opposite sign, swapped axes, another unit) and jumps
    beyond vibration are rejected. A fault ends in one of two ways: `_CONFIRM_READINGS` readings agree with the last
    accepted gravity, rotated by the gyroscope; or readings have changed smoothly and no mistake explains them, for
    half a second after a gap or another fault, for 10 s after a jump that no base can make.
    """

    MEMORY = 0.15  # [s] averaging time of mean, spread and roughness
    REST = 0.5  # [s] least duration of a rest
    GAP = 0.05  # [s] without samples after which any attitude is possible
    SPIKE = 3  # samples; the next good sample is accepted at once
    MAX_ALPHA = 50.0  # [rad/s2] of a base between two samples
    LEVER = 0.5  # [m] largest distance of the base's origin from its axis of rotation

    def __init__(self, base: BaseSpectrum, *, lever: float = 0.0, hanging: bool = False) -> None:
        """Set the platform's accelerations, the sensor's distance from the base's origin [m], and if it may hang."""
        self._lever = self.LEVER + lever
        self._times = np.array([base.mean_time, _MEAN_S])
        self._base, self._least_down = base, -1.0 if hanging else math.cos(_MAX_TILT)
        self.forget()

    def forget(self) -> None:
        """Forget all readings."""
        self.reference: Floats | None = None  # last accepted gravity, rotated by the gyroscope
        self._last, self.last_stamp = np.zeros(3), -math.inf
        self._bad, self._good, self._fault, self._mistake = 0, 0, Fault.NONE, _EYE
        self._bad_since = self._jump_since = math.inf
        self._impossible = False
        self.doubted_until = -math.inf  # [s] after a disagreement, which may end in a jump
        self.mean, self._variance, self._rough = np.zeros(3), 0.0, 0.0  # of recent readings; squared step of an axis
        self._lengths, self._mean_since, self._begun = np.zeros(2), math.inf, math.inf  # means over short and long
        self._leapt_at, self._leapt_from = math.inf, 0.0  # [s] of the last jump in length, and the length before it
        self._length, self._even, self._even_since = STANDARD_GRAVITY, 0.0, math.inf  # smoothed; constant value, since
        self._outwards = 0.0  # [m/s2] change of length by rotation
        self._rested = False  # the length was gravity's once
        self.steady_since = math.inf

    @property
    def is_steady(self) -> bool:
        """The readings, accepted or not, have been constant for `REST`."""
        return self.last_stamp - self.steady_since >= self.REST

    @property
    def is_long(self) -> bool:
        """The mean length of readings differs from gravity by more than slow accelerations and rotation explain."""
        young = self.last_stamp - self._mean_since < self._base.mean_time
        slow = self._base.slow_acceleration if young or self.is_steady else 0.0
        return abs(self._lengths[0] - STANDARD_GRAVITY) > self._tolerance + slow + self._outwards

    @property
    def length_off(self) -> float:
        """Length error that no motion of a base explains, constant or averaged over a minute [m/s2]; 0 for none."""
        steadily = abs(self._length - STANDARD_GRAVITY) - self._outwards
        longest = _EVEN_S if self._rested else _EVEN_FROM_START_S
        if self.last_stamp - self._even_since > (longest if self._base.slow_acceleration == 0.0 else _EVEN_SLOW_S):
            return steadily if steadily > _MIN_LENGTH_ERROR else 0.0
        off = abs(self._lengths[1] - STANDARD_GRAVITY)
        is_sure = self.last_stamp - self._mean_since > _MEAN_S
        return off if is_sure and off > self._tolerance + self._outwards else 0.0

    @property
    def _tolerance(self) -> float:
        # vibration lengthens readings in the mean
        residual = _SLOW_RESIDUAL if self._base.slow_acceleration > 0.0 else 0.0
        return _CALIBRATION + residual + 3.0 * self._rough / STANDARD_GRAVITY

    def fault(self, stamp: float, gravity: Floats, expected: Floats, rate: Floats | None, swing: float = 0.0) -> Fault:
        """Return the fault of a reading, NONE if it has none.

        gravity (3,) is the reading in base axes, expected (3,) its prediction from accepted ones, not used before the
        first; rate (3,) the angular velocity [rad/s], if known, and swing a bound on its derivative [rad/s2].
        """
        dt = stamp - self.last_stamp
        step = norm(gravity - self._last) if math.isfinite(dt) else math.inf
        length, limit = norm(gravity), self._base.jolt + _ROUGH_SIGMAS * math.sqrt(self._rough)
        self._watch_rest(stamp, gravity, dt, length, limit)
        self._last, self.last_stamp = gravity, stamp
        if self.reference is None:
            return self._begin(stamp, gravity, dt, step, limit)
        outwards = 0.0 if rate is None else self._lever * (float(rate @ rate) + swing)
        self._outwards = max(outwards, self._outwards * math.exp(-dt / self._base.mean_time))
        share = 1.0 if self._even == 0.0 else min(1.0, dt / _SMOOTH_S)
        self._length += share * (norm(expected) - self._length)
        self._rested |= abs(self._length - STANDARD_GRAVITY) < _MIN_LENGTH_ERROR
        if abs(self._length - self._even) > _EVEN_LENGTH:
            self._even, self._even_since = self._length, stamp
        fault = self._length_fault(length, expected)
        is_back = abs(self._lengths[0] - self._leapt_from) < 0.5 * limit + self._base.slow_acceleration
        if is_back or stamp - self._leapt_at > _TRUST_AGAIN_S:
            self._leapt_at = math.inf
        if fault is Fault.NONE and self._leapt_at < math.inf:
            fault = Fault.MAGNITUDE
        max_step = limit + self._lever * swing + 0.5 * self.MAX_ALPHA * min(dt, 2.0 * self.GAP) ** 2 * length
        if self._bad > 0 and rate is not None and dt < 0.1:
            self.reference = self.reference - dt * cross(rate, self.reference)
        # after a fault the prediction is old: compare with the last accepted gravity
        predicted = expected if self._bad == 0 else self.reference
        off, moved_on = norm(gravity - predicted), 0.0
        if self._bad == 0:
            off = min(step, off)
            if fault is Fault.NONE and off < 0.8 * max_step:
                self._roughen(dt, step, limit)
        else:  # slow accelerations since the last accepted reading
            moved_on = min(self._base.slow_acceleration, self._base.slow_jerk * (stamp - self._bad_since))
            if fault is Fault.NONE and self._bad > self.SPIKE:
                self._roughen(dt, step, limit)
        if fault is Fault.NONE and off <= max_step + moved_on and not self._is_hidden(gravity, max_step):
            self._good += 1
            if self._bad > self.SPIKE and self._good < _CONFIRM_READINGS:
                return self._fault  # a single good sample may be chance
            return self._believe(gravity)
        return self._doubt(stamp, gravity, predicted, step, max_step, dt, fault)

    def _doubt(
        self, stamp: float, gravity: Floats, predicted: Floats, step: float, max_step: float, dt: float, fault: Fault
    ) -> Fault:
        """Return the fault of a reading that differs from `predicted` (3,), or accept it if the difference lasts."""
        self._bad += 1
        self._good = 0
        # a mistake shows at once; if gravity resembles it later, the base has turned meanwhile
        if fault is Fault.NONE and (self._bad <= self.SPIKE or self._fault in (Fault.WRONG_SIGN, Fault.AXES_SWAPPED)):
            mistake, correction = explain(gravity, predicted)
            if mistake is not Fault.NONE:
                fault, self._mistake = mistake, correction
            elif (
                self._mistake is not _EYE
                and norm(self._mistake @ gravity - predicted) <= norm(gravity - predicted) + max_step
            ):
                fault = self._fault
        if self._bad == 1:
            self._bad_since = stamp
            self._impossible = fault is Fault.NONE and dt < self.GAP and stamp > self.doubted_until
        if fault is not Fault.NONE:
            self._jump_since = math.inf  # a mistake is never accepted, however long it lasts
            if fault is Fault.MAGNITUDE and self._bad <= self.SPIKE and not self.is_steady:
                fault = Fault.SPIKE
        else:
            if step > max_step or self._jump_since == math.inf:
                self._jump_since = stamp
            after = _TRUST_AGAIN_S if self._impossible else _ACCEPT_JUMP_S
            if stamp - self._jump_since >= after:
                return self._believe(gravity)
            fault = Fault.SPIKE if self._bad <= self.SPIKE else Fault.JUMP
        self._fault = fault
        return fault

    def _is_hidden(self, gravity: Floats, limit: float) -> bool:
        """Check if the detected mistake leaves a reading unchanged, so that its end cannot be seen."""
        return self._bad > self.SPIKE and norm(self._mistake @ gravity - gravity) < limit and self._mistake is not _EYE

    def _believe(self, gravity: Floats) -> Fault:
        self._bad, self._jump_since, self._mistake = 0, math.inf, _EYE
        self.reference = gravity
        return Fault.NONE

    def _begin(self, stamp: float, gravity: Floats, dt: float, step: float, limit: float) -> Fault:
        """Accept the first samples once a few in a row agree, or vibrate about gravity for long enough."""
        self._good = self._good + 1 if step <= limit else 1
        if self._good == 1:
            self._begun = stamp
        shaken = math.sqrt(self._rough) > _REST_SPREAD
        self._roughen(dt, step, limit)
        down = self.mean if shaken else gravity
        length = norm(down)
        fault = self._length_fault(length, None)
        if fault is Fault.NONE and abs(length - STANDARD_GRAVITY) > self._tolerance + self._base.slow_acceleration:
            fault = Fault.MAGNITUDE
        if fault is Fault.NONE and down[2] > -self._least_down * length:
            fault = Fault.UPSIDE_DOWN
        if fault is not Fault.NONE and not shaken:
            self._good = 0
        elif (
            fault is Fault.NONE
            and self._good >= _CONFIRM_READINGS
            and (not shaken or stamp - self._begun > self.MEMORY)
        ):
            self._believe(gravity)
        return fault

    def _roughen(self, dt: float, step: float, limit: float) -> None:
        """Update the variance of steps by noise and vibration, limited to just above its present value."""
        if math.isfinite(step):
            share = 1.0 - math.exp(-dt / self.MEMORY)
            self._rough += share * (min(step, limit) ** 2 / 6.0 - self._rough)

    def _length_fault(self, length: float, expected: Floats | None) -> Fault:
        if abs(length - STANDARD_GRAVITY) <= _MAX_ACCELERATION + self._outwards + 6.0 * math.sqrt(self._rough):
            return Fault.NONE
        off = 0.15 + self._base.slow_acceleration / STANDARD_GRAVITY
        in_g, stripped = abs(length - 1.0) <= off, length < 2.5
        if in_g and stripped and expected is not None:
            true = norm(expected)
            in_g = abs(length - true / STANDARD_GRAVITY) <= abs(length - abs(true - STANDARD_GRAVITY))
        if in_g:
            return Fault.UNIT_G
        if abs(length / 1000.0 - 1.0) <= off:
            return Fault.UNIT_CM
        return Fault.GRAVITY_STRIPPED if stripped else Fault.MAGNITUDE

    def _watch_rest(self, stamp: float, gravity: Floats, dt: float, length: float, limit: float) -> None:
        if not 0.0 < dt < self.REST or abs(length - norm(self._last)) > limit:
            if self.reference is not None and dt < self.REST and math.isinf(self._leapt_at):
                self._leapt_at, self._leapt_from = stamp, float(self._lengths[0])
            self._lengths[:], self._mean_since = length, stamp
        else:
            # at first a plain mean: an exponential one would be biased by the first part of a wave
            shares = np.maximum(dt / (stamp - self._mean_since), 1.0 - np.exp(-dt / self._times))
            self._lengths += shares * (length - self._lengths)
        if not 0.0 < dt < self.REST:
            self.mean, self._variance, self.steady_since = gravity, 0.0, stamp
            return
        share = 1.0 - math.exp(-dt / self.MEMORY)
        off = gravity - self.mean
        self.mean = self.mean + share * off
        self._variance = (1.0 - share) * (self._variance + share * float(off @ off))
        if self._variance > _REST_SPREAD**2:
            self.steady_since = math.inf
        elif self.steady_since == math.inf:
            self.steady_since = stamp


class RateCheck:
    """Detect angular rates that a base cannot have, or that contradict earlier ones."""

    def __init__(self) -> None:
        self._last = np.zeros(3)
        self._alike = 0  # consecutive samples, each near its predecessor
        self._doubted = False
        self.believed = False  # the last sample is accepted; waiting for the first few is no fault
        self.leapt = False  # rates are accepted again after a jump to other values

    def fault(self, rate: Floats, expected: Floats | None) -> Fault:
        """Return the fault of a rate (3,) [rad/s]; `expected` (3,) is its prediction, None if that is too old."""
        self._alike = self._alike + 1 if norm(rate - self._last) <= _MAX_RATE_STEP else 0
        self._last = rate
        self.believed = self.leapt = False
        if norm(rate) > _MAX_RATE:
            self._alike, self._doubted = 0, True
            return Fault.RATE_TOO_FAST
        agrees = expected is not None and norm(rate - expected) <= _MAX_RATE_STEP
        # a few that agree with each other are accepted, whatever the prediction
        if agrees or self._alike >= _CONFIRM_READINGS:
            self.leapt = self._doubted and not agrees
            self.believed, self._doubted = True, False
            return Fault.NONE
        self._doubted |= expected is not None
        return Fault.RATE_SPIKE if self._doubted else Fault.NONE


def explain(gravity: Floats, expected: Floats) -> tuple[Fault, Floats]:
    """Identify a sign or axis error whose correction (3, 3) brings a reading (3,) five times nearer to `expected`.

    NONE and the identity if there is none.
    """
    off = 0.2 * norm(gravity - expected)
    if norm(gravity + expected) < off:
        return Fault.WRONG_SIGN, -_EYE
    for order in _ORDERS:  # axes swapped or negated
        mended = np.sign(gravity[order] * expected)[:, None] * _EYE[order]
        if norm(mended @ gravity - expected) < off:
            return Fault.AXES_SWAPPED, mended
    return Fault.NONE, _EYE


def norm(v: Floats) -> float:
    """Return the length of a vector (3,)."""
    return math.hypot(v[0], v[1], v[2])
