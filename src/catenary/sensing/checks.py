"""Which samples of an accelerometer or a gyroscope are believed; the others are named by their fault."""

import math
import tomllib
from dataclasses import asdict, dataclass, replace
from enum import Flag, auto
from functools import cache
from importlib.resources import files

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.bases import BaseSpectrum, base_spectrum
from catenary.spatial import STANDARD_GRAVITY, cross

Vector = tuple[float, float, float]
_MAY_BE_ZERO = ("slow_acceleration", "slow_jerk", "stuck_samples", "accept_jump_after", "trust_again_after", "future")
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
    NOT_FOLLOWED = auto()
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


@dataclass(frozen=True)
class SensorRules:
    """What is believed of a sensor; the defaults fit a table: a base that people tilt, rock or push about.

    Rules of bases that move by themselves: `rules_for`. Lengths are of readings, gravity's at rest.
    """

    max_step: float = 1.2  # [m/s2] between a reading and what those before it foretell
    max_rate_step: float = 0.5  # [rad/s] the same of angular rates
    max_rate: float = 4.0  # [rad/s] fastest turning of the base; rocking by 20 degrees at 1 Hz is 2.2
    max_acceleration: float = 6.0  # [m/s2] of the base: a length is gravity's, give or take it
    rest_lower: float = 9.0  # [m/s2] least length at rest, and of the mean over `mean_time`
    rest_upper: float = 10.6  # [m/s2] the largest
    rest_spread: float = 0.3  # [m/s2] standard deviation at rest, of the three axes together, at most
    mean_time: float = 1.0  # [s] over which the accelerations of a base that moves average out
    # [m/s2] that lasts for seconds, as a ship's heave or a car's braking: what seems to be at rest, and the first
    # readings, may be as much longer or shorter than rest_lower and rest_upper say; 0: it does not move by itself
    slow_acceleration: float = 0.0
    slow_jerk: float = 0.0  # [m/s3] how fast it changes, at most
    max_tilt: float = math.radians(120.0)  # [rad] from level when samples begin; pi for a base that may hang
    # [m/s2] between a reading and gravity as the gyroscope foretells it that does not show in its length, while the
    # gyroscope says that the base stands still: no table is pushed harder. 1.4 is a tip of 8 degrees; inf asks nothing
    max_push: float = 1.4
    still_rate: float = 0.15  # [rad/s] below which a gyroscope says that the base stands still; more than its bias
    stuck_samples: int = 10  # identical readings in a row make a sensor stuck; 0 believes one without any noise
    confirm: int = 5  # good readings in a row before a sensor is believed, at first or after a fault
    # [s] for which a jump that nothing explains must last to be believed, and sensors that disagreed must agree
    accept_jump_after: float = 0.5
    # [s] of good readings after which a sensor is believed that jumped as no base can; inf: never
    trust_again_after: float = 10.0
    future: float = 0.005  # [s] by which a stamp may lie ahead of the reader's clock

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            may_be_zero = name in _MAY_BE_ZERO
            if not (value > 0 or (may_be_zero and value == 0)):
                least = "0 or more" if may_be_zero else "more than 0"
                raise InputError(f"sensor rules: {name}: expected {least}, got {value}")
        if not self.rest_lower < self.rest_upper:
            raise InputError(
                f"sensor rules: rest_lower {self.rest_lower}: expected less than rest_upper {self.rest_upper}"
            )


class RawCheck:
    """Faults that show in a reading alone and the one before, in the sensor's own axes."""

    # closer than that is no second measurement, and parabolas through it would be noise
    CLOSEST = 1e-4  # [s]
    ABSURD = 1e5  # in any unit: as good as infinite

    def __init__(self, rules: SensorRules, full_range: float, faults: tuple[Fault, Fault, Fault]) -> None:
        """Take the range of an axis, and the faults of readings that are not finite, stuck and saturated."""
        self._rules = rules
        # what lies far beyond the range does not come from a sensor that is at its end: another unit, or a spike
        self._end, self._beyond = 0.995 * full_range, 1.05 * full_range
        self._not_finite, self._stuck, self._saturated = faults
        self._newest = -math.inf
        self._last: Vector = (math.nan, math.nan, math.nan)
        self._same = 1

    def fault(self, stamp: float, vector: Vector, now: float) -> Fault:
        """Return the fault of a reading, NONE if it has none."""
        if not math.isfinite(stamp) or stamp > now + self._rules.future:
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
        if self._same >= self._rules.stuck_samples > 0:
            return self._stuck
        if self._end <= largest <= self._beyond:
            return self._saturated
        return Fault.NONE


class GravityCheck:
    """Faults of readings that cannot be gravity seen from a base, or do not follow from those before.

    Works on free-fall acceleration in base axes. What no base can do is rejected until the readings come back:
    mistakes of a sensor (opposite sign, swapped axes, another unit), and jumps from one sample to the next. How a fault
    is left is one rule: the readings are back at gravity as last believed, turned along with the gyroscope, for
    `confirm` of them; or they have changed smoothly for a while, explained by no mistake: for `accept_jump_after` where
    another gravity may be true, after a gap or other faults, for `trust_again_after` where no base can turn so.
    """

    MEMORY = 0.15  # [s] over which the spread of readings at rest is taken
    REST = 0.5  # [s] for which it must hold
    GAP = 0.05  # [s] without samples, in which a base may have gone anywhere
    FEW = 3  # bad samples in a row that are a spike, after which the next good one is believed at once
    JERKY = 50.0  # [rad/s2] with which a base may begin to turn between two samples
    LEVER = 0.5  # [m] from the axis that a base turns about, at most: by it readings are longer or shorter

    def __init__(self, rules: SensorRules) -> None:
        self._rules = rules
        self.forget()

    def forget(self) -> None:
        """Forget all readings."""
        self.reference: Floats | None = None  # gravity as last believed, turned along with the gyroscope
        self._last = np.zeros(3)
        self.last_stamp = -math.inf
        self._bad, self._good, self._fault = 0, 0, Fault.NONE
        self._bad_since = math.inf
        self._jump_since = math.inf
        self._impossible = False
        self.doubted_until = -math.inf  # [s] by a disagreement, whose end may be a jump
        self.mean, self._variance = np.zeros(3), 0.0  # of readings of late
        self._mean_length, self._mean_since = 0.0, math.inf
        self.steady_since = math.inf

    @property
    def is_steady(self) -> bool:
        """The readings, believed or not, have stood still for a while."""
        return self.last_stamp - self.steady_since >= self.REST

    def fault(self, stamp: float, gravity: Floats, expected: Floats, rate: Floats | None, swing: float = 0.0) -> Fault:
        """Return the fault of a reading, NONE if it has none.

        gravity (3,) is the reading, expected (3,) its prediction by the believed ones before it, not used before there
        are any; rate (3,) the angular velocity [rad/s], where it is known, and swing its change, at most [rad/s2].
        """
        rules = self._rules
        dt = stamp - self.last_stamp
        step = norm(gravity - self._last) if math.isfinite(dt) else math.inf
        length = norm(gravity)
        self._watch_rest(stamp, gravity, dt, length)
        self._last, self.last_stamp = gravity, stamp
        outwards = 0.0 if rate is None else self.LEVER * (float(rate @ rate) + swing)
        fault = self._length_fault(length, outwards, None if self.reference is None else expected)
        if self.reference is None:
            return self._begin(gravity, length, step, fault)
        max_step = rules.max_step + self.LEVER * swing + 0.5 * self.JERKY * min(dt, 2.0 * self.GAP) ** 2 * length
        if self._bad > 0 and rate is not None and dt < 0.1:
            self.reference = self.reference - dt * cross(rate, self.reference)
        # after a fault the prediction is old: gravity as last believed is what to come back to
        wanted = expected if self._bad == 0 else self.reference
        off, moved_on = norm(gravity - wanted), 0.0
        if self._bad == 0:
            off = min(step, off)
        else:  # by slow accelerations since it was last believed
            moved_on = min(rules.slow_acceleration, rules.slow_jerk * (stamp - self._bad_since))
        if fault is Fault.NONE and off <= max_step + moved_on:
            self._good += 1
            if self._bad > self.FEW and self._good < rules.confirm:
                return self._fault  # one good sample may be luck
            return self._believe(gravity)
        self._bad += 1
        self._good = 0
        # a mistake shows at once: where gravity is like it later, the base has turned so meanwhile
        if fault is Fault.NONE and (self._bad <= self.FEW or self._fault in (Fault.WRONG_SIGN, Fault.AXES_SWAPPED)):
            fault = explain(gravity, wanted)
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
            after = rules.trust_again_after if self._impossible else rules.accept_jump_after
            if stamp - self._jump_since >= after:
                return self._believe(gravity)
            fault = Fault.SPIKE if self._bad <= self.FEW else Fault.JUMP
        self._fault = fault
        return fault

    def _believe(self, gravity: Floats) -> Fault:
        self._bad, self._jump_since = 0, math.inf
        self.reference = gravity
        return Fault.NONE

    def _begin(self, gravity: Floats, length: float, step: float, fault: Fault) -> Fault:
        """Believe the first samples once a few in a row are alike, and of gravity's length."""
        rules = self._rules
        if fault is Fault.NONE and not self._is_gravity(length, rules.slow_acceleration):
            fault = Fault.MAGNITUDE
        if fault is Fault.NONE and gravity[2] > -math.cos(rules.max_tilt) * length:
            fault = Fault.UPSIDE_DOWN
        if fault is not Fault.NONE:
            self._good = 0
            return fault
        self._good = self._good + 1 if step <= rules.max_step else 1
        if self._good >= rules.confirm:
            self._believe(gravity)
        return Fault.NONE

    def _length_fault(self, length: float, outwards: float, expected: Floats | None) -> Fault:
        rules, slow = self._rules, self._rules.slow_acceleration
        if abs(length - STANDARD_GRAVITY) <= rules.max_acceleration:
            young = self.last_stamp - self._mean_since < rules.mean_time
            # lengths, and not vectors, are averaged: those of a base that turns point everywhere
            fits = self._is_gravity(self._mean_length, outwards + (slow if young else 0.0))
            if self.is_steady:
                # what stands still for half a second is at rest, or in the middle of a slow acceleration
                fits = self._is_gravity(norm(self.mean), outwards + slow) and (fits or slow == 0.0)
            return Fault.NONE if fits else Fault.MAGNITUDE
        off = 0.15 + slow / STANDARD_GRAVITY
        in_g, stripped = abs(length - 1.0) <= off, length < 2.5
        if in_g and stripped and expected is not None:
            true = norm(expected)
            in_g = abs(length - true / STANDARD_GRAVITY) <= abs(length - abs(true - STANDARD_GRAVITY))
        if in_g:
            return Fault.UNIT_G
        if abs(length / 1000.0 - 1.0) <= off:
            return Fault.UNIT_CM
        return Fault.GRAVITY_STRIPPED if stripped else Fault.MAGNITUDE

    def _is_gravity(self, length: float, slow: float) -> bool:
        """Return whether a length is gravity's, give or take a slow acceleration."""
        return self._rules.rest_lower - slow <= length <= self._rules.rest_upper + slow

    def _watch_rest(self, stamp: float, gravity: Floats, dt: float, length: float) -> None:
        """Update running means and variance, to know when readings stand still, and how long they are in the mean."""
        if not 0.0 < dt < self.REST or abs(length - norm(self._last)) > self._rules.max_step:
            self._mean_length, self._mean_since = length, stamp
        else:
            # at first over all readings there were: of a wave's first part one that forgets would keep most
            share = max(dt / (stamp - self._mean_since), 1.0 - math.exp(-dt / self._rules.mean_time))
            self._mean_length += share * (length - self._mean_length)
        if not 0.0 < dt < self.REST:
            self.mean, self._variance, self.steady_since = gravity, 0.0, stamp
            return
        share = 1.0 - math.exp(-dt / self.MEMORY)
        off = gravity - self.mean
        self.mean = self.mean + share * off
        self._variance = (1.0 - share) * (self._variance + share * float(off @ off))
        if self._variance > self._rules.rest_spread**2:
            self.steady_since = math.inf
        elif self.steady_since == math.inf:
            self.steady_since = stamp


class RateCheck:
    """Faults of angular rates that cannot be a base's, or do not follow from those before."""

    def __init__(self, rules: SensorRules) -> None:
        self._rules = rules
        self._last = np.zeros(3)
        self._alike = 0  # samples in a row, each near the one before
        self._doubted = False
        self.believed = False  # the last one; the first few are waited for, which is no fault

    def fault(self, rate: Floats, expected: Floats | None) -> Fault:
        """Return the fault of a rate (3,) [rad/s]; `expected` is the prediction by those before, None if too old."""
        rules = self._rules
        self._alike = self._alike + 1 if norm(rate - self._last) <= rules.max_rate_step else 0
        self._last = rate
        self.believed = False
        if norm(rate) > rules.max_rate:
            self._alike, self._doubted = 0, True
            return Fault.RATE_TOO_FAST
        near = expected is not None and norm(rate - expected) <= rules.max_rate_step
        # a few that agree with each other are believed whatever was before
        if near or self._alike >= rules.confirm:
            self.believed, self._doubted = True, False
            return Fault.NONE
        self._doubted |= expected is not None
        return Fault.RATE_SPIKE if self._doubted else Fault.NONE


def explain(gravity: Floats, wanted: Floats) -> Fault:
    """Return the mistake of a sensor that brings the reading five times nearer to what was expected, NONE if none."""
    off = norm(gravity - wanted)
    if 5.0 * norm(gravity + wanted) < off:
        return Fault.WRONG_SIGN
    a, b = np.abs(gravity), np.abs(wanted)
    # magnitudes agree in some order: each axis holds another one's number, or the wrong sign of it
    return Fault.AXES_SWAPPED if any(5.0 * norm(a[order] - b) < off for order in _ORDERS) else Fault.NONE


def norm(v: Floats) -> float:
    """Return the length of a vector (3,)."""
    return math.hypot(v[0], v[1], v[2])


# [m/s2] of a reading: 400 ug/sqrt(Hz) at 200 Hz, MPU-6050 specification rev. 3.4, table 6.2
CHEAP_NOISE = 0.04
_UNCALIBRATED_ERROR = 0.8  # [m/s2] by which a cheap sensor's length is off: 80 mg on its z axis, the same table
_REMAINING_ACCELERATION = 0.5  # [m/s2] of slow accelerations that may be left in the mean
_NOISE_SIGMAS = 5.0  # standard deviations within which noise stays, of one axis


def rules_for(
    base: str | BaseSpectrum, *, noise: float = CHEAP_NOISE, changes: dict[str, float] | None = None
) -> SensorRules:
    """Return the rules that suit a base and a sensor.

    With s the noise of a reading: a step may be the base's jolt and 5 s; readings at rest spread by 4 s on each of
    three axes, 0.3 m/s2 at least; slow accelerations a of frequencies from f on average out over `mean_time` T to
    3 a / (2 pi f T) at most, for which T is chosen; lengths in the mean are then gravity's, give or take what is left
    and what a sensor that nobody calibrated is off by. For a table and a cheap sensor these are the defaults of
    SensorRules. Noise is the standard deviation of an axis of a reading at rest [m/s2]; `changes` are fields of
    SensorRules that are to be others.
    """
    if not 0.0 <= noise < math.inf:
        raise InputError(f"sensor noise: expected 0 or more m/s2, got {noise}")
    spectrum = base_spectrum(base)
    slow = spectrum.slow_acceleration
    mean_time = max(1.0, 3.0 * slow / (2.0 * math.pi * spectrum.slowest_hz * _REMAINING_ACCELERATION))
    left = _UNCALIBRATED_ERROR + (_REMAINING_ACCELERATION if slow > 0.0 else 0.0)
    rules = SensorRules(
        max_step=round(spectrum.jolt + _NOISE_SIGMAS * noise, 3),
        max_rate=spectrum.turning,
        max_acceleration=spectrum.acceleration,
        rest_lower=round(STANDARD_GRAVITY - left, 1),
        rest_upper=round(STANDARD_GRAVITY + left, 1),
        rest_spread=round(max(0.3, 4.0 * math.sqrt(3.0) * noise), 3),
        mean_time=round(mean_time, 1),
        slow_acceleration=slow,
        slow_jerk=round(2.0 * math.pi * spectrum.fastest_hz * slow, 2),
        max_push=spectrum.push,
    )
    unknown = sorted(set(changes or ()) - set(vars(rules)))
    if unknown:
        raise InputError(f"sensor rules: no rule {', '.join(unknown)}; there are {', '.join(vars(rules))}")
    return replace(rules, **(changes or {}))  # type: ignore[arg-type]  # confirm and stuck_samples count
