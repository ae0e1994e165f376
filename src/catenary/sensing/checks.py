"""Which samples of an accelerometer or a gyroscope are believed; the others are named by their fault."""

import math
import tomllib
from enum import Flag, auto
from functools import cache
from importlib.resources import files

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.bases import BaseSpectrum
from catenary.spatial import STANDARD_GRAVITY, cross

Vector = tuple[float, float, float]
_MAX_RATE = 20.0  # [rad/s] no base turns so fast
_MAX_RATE_STEP = 0.5  # [rad/s] between a rate and what those before it foretell
_FUTURE_S = 0.005  # [s] by which a stamp may lie ahead of the reader's clock
CONFIRM = 5  # good readings in a row before a sensor is believed, at first or after a fault
_ACCEPT_JUMP_S = 0.5  # [s] for which a jump that nothing explains must last to be believed
_TRUST_AGAIN_S = 10.0  # [s] of good readings after which a sensor is believed that jumped as no base can
_MAX_TILT = math.radians(120.0)  # [rad] from level when samples begin, of a base that does not hang
_CALIBRATION = 0.8  # [m/s2] by which a cheap sensor's length is off: 80 mg on its z axis (MPU-6050, table 6.2)
_SLOW_LEFT = 0.5  # [m/s2] of slow accelerations that may be left in the mean
_MAX_ACCELERATION = 7.0  # [m/s2] of a base, beyond vibration: a length is gravity's, give or take it
_MINUTE_S = 60.0  # [s] over which the accelerations of every base average out
_EVEN, _SMOOTH_S = 0.06, 0.3  # [m/s2] to which a length is even, smoothed over so long [s]
# [s] for which no base accelerates evenly, and one that heaves slowly; by more than what may be live
_EVEN_S, _EVEN_SLOW_S, _OFF = 2.5, 10.0, 0.3
_REST_SPREAD = 0.3  # [m/s2] standard deviation at rest, of the three axes together, at most
_ROUGH_SIGMAS = 4.0  # standard deviations of vibration and noise that a step may have
_AS_IT_IS = np.eye(3)
_ORDERS = [np.array(p) for p in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))]


class Fault(Flag):
    """Faults, which may come together."""

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
        """What it means and what to do about it; a sentence for each of several faults."""
        return "; ".join(_messages()[name] for name in self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each, in lower case."""
        return tuple(str(fault.name).lower() for fault in self)


@cache
def _messages() -> dict[str, str]:
    return tomllib.loads((files("catenary.sensing") / "data/faults.toml").read_text(encoding="utf-8"))


class RawCheck:
    """Faults that show in a reading alone and the one before, in the sensor's own axes."""

    # closer than that is no second measurement, and parabolas through it would be noise
    CLOSEST = 1e-4  # [s]
    ABSURD = 1e5  # in any unit: as good as infinite

    def __init__(self, stuck_samples: int, full_range: float, faults: tuple[Fault, Fault, Fault]) -> None:
        """Take how many identical readings in a row make a sensor stuck, 0 for none; the range of an axis; and the
        faults of readings that are not finite, stuck and saturated.
        """
        self._stuck_samples = stuck_samples
        # what lies far beyond the range does not come from a sensor that is at its end: another unit, or a spike
        self._end, self._beyond = 0.995 * full_range, 1.05 * full_range
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
        if stamp - self._newest < self.CLOSEST:
            return Fault.STAMP_REPEATED
        x, y, z = vector
        largest = max(abs(x), abs(y), abs(z))
        if not (math.isfinite(x + y + z) and largest < self.ABSURD):
            return self._not_finite
        self._newest = stamp
        self._same = self._same + 1 if vector == self._last else 1
        self._last = vector
        if self._same >= self._stuck_samples > 0:
            return self._stuck
        if self._end <= largest <= self._beyond:
            return self._saturated
        return Fault.NONE


class GravityCheck:
    """Faults of readings that cannot be gravity seen from a base, or do not follow from those before.

    Works on free-fall acceleration in base axes. What no base can do is rejected until the readings come back:
    mistakes of a sensor (opposite sign, swapped axes, another unit), and jumps from one sample to the next, beyond what
    vibration makes of them. How a fault is left is one rule: the readings are back at gravity as last believed, turned
    along with the gyroscope, for `CONFIRM` of them; or they have changed smoothly for a while, explained by no mistake:
    for half a second where another gravity may be true, after a gap or other faults, for ten where no base can turn so.
    """

    MEMORY = 0.15  # [s] over which mean, spread and roughness are taken
    REST = 0.5  # [s] for which readings must stand still
    GAP = 0.05  # [s] without samples, in which a base may have gone anywhere
    FEW = 3  # bad samples in a row that are a spike, after which the next good one is believed at once
    JERKY = 50.0  # [rad/s2] with which a base may begin to turn between two samples
    LEVER = 0.5  # [m] from the axis that a base turns about, at most: by it readings are longer or shorter

    def __init__(self, base: BaseSpectrum, *, lever: float = 0.0, hanging: bool = False) -> None:
        """Take how the base moves by itself, how far from its origin the sensor is [m], and whether it may hang."""
        self._lever = self.LEVER + lever
        self._times = np.array([base.mean_time, _MINUTE_S])
        self._base, self._least_down = base, -1.0 if hanging else math.cos(_MAX_TILT)
        self.forget()

    def forget(self) -> None:
        """Forget all readings."""
        self.reference: Floats | None = None  # gravity as last believed, turned along with the gyroscope
        self._last, self.last_stamp = np.zeros(3), -math.inf
        self._bad, self._good, self._fault, self._mistake = 0, 0, Fault.NONE, _AS_IT_IS
        self._bad_since = self._jump_since = math.inf
        self._impossible = False
        self.doubted_until = -math.inf  # [s] by a disagreement, whose end may be a jump
        self.mean, self._variance, self._rough = np.zeros(3), 0.0, 0.0  # of readings of late; an axis's step, squared
        self._lengths, self._mean_since, self._begun = np.zeros(2), math.inf, math.inf  # in the mean, short and long
        self._leapt_at, self._leapt_from = math.inf, 0.0  # [s] when the length last was another at once, and which
        self._length, self._even, self._even_since = STANDARD_GRAVITY, 0.0, math.inf  # smoothed; where and since when
        self._outwards = 0.0  # [m/s2] that turning may make of a length
        self.steady_since = math.inf

    @property
    def is_steady(self) -> bool:
        """The readings, believed or not, have stood still for a while."""
        return self.last_stamp - self.steady_since >= self.REST

    @property
    def is_long(self) -> bool:
        """Readings are longer or shorter in the mean than gravity, slow accelerations and turning make them."""
        young = self.last_stamp - self._mean_since < self._base.mean_time
        slow = self._base.slow_acceleration if young or self.is_steady else 0.0
        return abs(self._lengths[0] - STANDARD_GRAVITY) > self._tolerance + slow + self._outwards

    @property
    def length_off(self) -> float:
        """How much longer or shorter than gravity readings are, evenly or over a minute, as no base moves [m/s2]."""
        steadily = abs(self._length - STANDARD_GRAVITY) - self._outwards
        if self.last_stamp - self._even_since > (_EVEN_S if self._base.slow_acceleration == 0.0 else _EVEN_SLOW_S):
            return steadily if steadily > _OFF else 0.0
        off = abs(self._lengths[1] - STANDARD_GRAVITY)
        is_sure = self.last_stamp - self._mean_since > _MINUTE_S
        return off if is_sure and off > self._tolerance + self._outwards else 0.0

    @property
    def _tolerance(self) -> float:
        # vibration lengthens readings in the mean
        left = _SLOW_LEFT if self._base.slow_acceleration > 0.0 else 0.0
        return _CALIBRATION + left + 3.0 * self._rough / STANDARD_GRAVITY

    def fault(self, stamp: float, gravity: Floats, expected: Floats, rate: Floats | None, swing: float = 0.0) -> Fault:
        """Return the fault of a reading, NONE if it has none.

        gravity (3,) is the reading, expected (3,) its prediction by the believed ones before it, not used before there
        are any; rate (3,) the angular velocity [rad/s], where it is known, and swing its change, at most [rad/s2].
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
        self._length += min(1.0, dt / _SMOOTH_S) * (norm(expected) - self._length)
        if abs(self._length - self._even) > _EVEN:
            self._even, self._even_since = self._length, stamp
        fault = self._length_fault(length, expected)
        is_back = abs(self._lengths[0] - self._leapt_from) < 0.5 * limit + self._base.slow_acceleration
        if is_back or stamp - self._leapt_at > _TRUST_AGAIN_S:
            self._leapt_at = math.inf
        if fault is Fault.NONE and self._leapt_at < math.inf:
            fault = Fault.MAGNITUDE
        max_step = limit + self._lever * swing + 0.5 * self.JERKY * min(dt, 2.0 * self.GAP) ** 2 * length
        if self._bad > 0 and rate is not None and dt < 0.1:
            self.reference = self.reference - dt * cross(rate, self.reference)
        # after a fault the prediction is old: gravity as last believed is what to come back to
        wanted = expected if self._bad == 0 else self.reference
        off, moved_on = norm(gravity - wanted), 0.0
        if self._bad == 0:
            off = min(step, off)
            if fault is Fault.NONE and off < 0.8 * max_step:
                self._roughen(dt, step, limit)
        else:  # by slow accelerations since it was last believed
            moved_on = min(self._base.slow_acceleration, self._base.slow_jerk * (stamp - self._bad_since))
            if fault is Fault.NONE and self._bad > self.FEW:
                self._roughen(dt, step, limit)
        if fault is Fault.NONE and off <= max_step + moved_on and not self._may_be_mistaken(gravity, max_step):
            self._good += 1
            if self._bad > self.FEW and self._good < CONFIRM:
                return self._fault  # one good sample may be luck
            return self._believe(gravity)
        return self._doubt(stamp, gravity, wanted, step, max_step, dt, fault)

    def _doubt(
        self, stamp: float, gravity: Floats, wanted: Floats, step: float, max_step: float, dt: float, fault: Fault
    ) -> Fault:
        """Return the fault of a reading that is not what was wanted (3,), or believe it where that has lasted."""
        self._bad += 1
        self._good = 0
        # a mistake shows at once: where gravity is like it later, the base has turned so meanwhile
        if fault is Fault.NONE and (self._bad <= self.FEW or self._fault in (Fault.WRONG_SIGN, Fault.AXES_SWAPPED)):
            found, mend = explain(gravity, wanted)
            if found is not Fault.NONE:
                fault, self._mistake = found, mend
            elif (
                self._mistake is not _AS_IT_IS
                and norm(self._mistake @ gravity - wanted) <= norm(gravity - wanted) + max_step
            ):
                fault = self._fault
        if self._bad == 1:
            self._bad_since = stamp
            self._impossible = fault is Fault.NONE and dt < self.GAP and stamp > self.doubted_until
        if fault is not Fault.NONE:
            self._jump_since = math.inf  # a mistake does not become true by lasting
            if fault is Fault.MAGNITUDE and self._bad <= self.FEW and not self.is_steady:
                fault = Fault.SPIKE
        else:
            if step > max_step or self._jump_since == math.inf:
                self._jump_since = stamp
            after = _TRUST_AGAIN_S if self._impossible else _ACCEPT_JUMP_S
            if stamp - self._jump_since >= after:
                return self._believe(gravity)
            fault = Fault.SPIKE if self._bad <= self.FEW else Fault.JUMP
        self._fault = fault
        return fault

    def _may_be_mistaken(self, gravity: Floats, limit: float) -> bool:
        """Whether a mistake that was found leaves a reading as it is: it does not show then whether it has gone."""
        return (
            self._bad > self.FEW and norm(self._mistake @ gravity - gravity) < limit and self._mistake is not _AS_IT_IS
        )

    def _believe(self, gravity: Floats) -> Fault:
        self._bad, self._jump_since, self._mistake = 0, math.inf, _AS_IT_IS
        self.reference = gravity
        return Fault.NONE

    def _begin(self, stamp: float, gravity: Floats, dt: float, step: float, limit: float) -> Fault:
        """Believe the first samples once a few in a row are alike, or shake about gravity for long enough."""
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
        elif fault is Fault.NONE and self._good >= CONFIRM and (not shaken or stamp - self._begun > self.MEMORY):
            self._believe(gravity)
        return fault

    def _roughen(self, dt: float, step: float, limit: float) -> None:
        """Learn from a step how much readings differ by noise and vibration, a little beyond what they did."""
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
        """Update running means and variance, to know when readings stand still, and how long they are in the mean."""
        if not 0.0 < dt < self.REST or abs(length - norm(self._last)) > limit:
            if self.reference is not None and dt < self.REST and math.isinf(self._leapt_at):
                self._leapt_at, self._leapt_from = stamp, float(self._lengths[0])
            self._lengths[:], self._mean_since = length, stamp
        else:
            # at first over all readings there were: of a wave's first part one that forgets would keep most
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
    """Faults of angular rates that cannot be a base's, or do not follow from those before."""

    def __init__(self) -> None:
        self._last = np.zeros(3)
        self._alike = 0  # samples in a row, each near the one before
        self._doubted = False
        self.believed = False  # the last one; the first few are waited for, which is no fault
        self.leapt = False  # it is believed again after a leap, elsewhere than before

    def fault(self, rate: Floats, expected: Floats | None) -> Fault:
        """Return the fault of a rate (3,) [rad/s]; `expected` is the prediction by those before, None if too old."""
        self._alike = self._alike + 1 if norm(rate - self._last) <= _MAX_RATE_STEP else 0
        self._last = rate
        self.believed = self.leapt = False
        if norm(rate) > _MAX_RATE:
            self._alike, self._doubted = 0, True
            return Fault.RATE_TOO_FAST
        near = expected is not None and norm(rate - expected) <= _MAX_RATE_STEP
        # a few that agree with each other are believed whatever was before
        if near or self._alike >= CONFIRM:
            self.leapt = self._doubted and not near
            self.believed, self._doubted = True, False
            return Fault.NONE
        self._doubted |= expected is not None
        return Fault.RATE_SPIKE if self._doubted else Fault.NONE


def explain(gravity: Floats, wanted: Floats) -> tuple[Fault, Floats]:
    """Return the mistake of a sensor that brings a reading five times nearer to what was expected, and what mends it.

    NONE and the identity (3, 3) if there is none.
    """
    off = 0.2 * norm(gravity - wanted)
    if norm(gravity + wanted) < off:
        return Fault.WRONG_SIGN, -_AS_IT_IS
    for order in _ORDERS:  # each axis holds another one's number, or the wrong sign of it
        mended = np.sign(gravity[order] * wanted)[:, None] * _AS_IT_IS[order]
        if norm(mended @ gravity - wanted) < off:
            return Fault.AXES_SWAPPED, mended
    return Fault.NONE, _AS_IT_IS


def norm(v: Floats) -> float:
    """Return the length of a vector (3,)."""
    return math.hypot(v[0], v[1], v[2])
