"""The gravity vector from an accelerometer, or from an accelerometer and a gyroscope, on the robot's base."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.bases import BaseSpectrum, base_spectrum
from catenary.sensing.checks import Fault, GravityCheck, RateCheck, RawCheck, norm
from catenary.sensing.fallback import SlowAttitude, SmoothTransfer
from catenary.sensing.fallbacks import FALLBACKS
from catenary.sensing.gyro_prediction import PredictedGravity, RestRate
from catenary.sensing.memories import Memories, lever, motion
from catenary.sensing.mounting import Mounting
from catenary.sensing.turning import HIGH_PASS_S, TurningWatch
from catenary.sensing.vector import GravityReading, Kind, Mailbox, ReadingStatus, SensorSample
from catenary.spatial import LEVEL, STANDARD_GRAVITY

# how fast gravity, angular velocity and acceleration of the base may change as measured [m/s3, rad/s2, rad/s3]:
# ten times what rocking by 10 degrees at 1 Hz takes; and how fast they come back from a fault
_FOLLOWING = (100.0, 50.0, 400.0)
_RECOVERING = (10.0, 5.0, 40.0)
_MAX_SAMPLES_A_TICK = 64  # a queue that built up does not hold the tick up
_FAULT_MEMORY_S = 0.1  # for which a fault is reported after the sample that showed it
_PAUSE_S = 0.5  # between reads, after which they begin anew
_FORGET_AFTER_S = 1.0  # without samples, after which a sensor is met anew
_LIVE_WITHIN = 0.3  # [m/s2] of gravity that is live: two deviations, turns that nothing checked, the way back
_QUIET, _QUIET_RATE = 1e-3, 1e-5  # [m/s2, rad/s] least noise of a sample
_GAP_S = 0.25  # without samples, over which no parabola is laid
_RATES_S = 0.04  # of rates, before which they tell no acceleration
_NOISY_SWING = 2.0  # [rad/s2] of angular acceleration that noise may be
_SUDDEN = 0.3  # [m/s2] between a reading and its prediction that noise may be
_OWN_S, _BEGINNING_S = 0.2, 0.04  # over which gravity's own change tells a turn, and in which one may have begun
_SHAKES = 0.5  # [m/s2] of vibration in which single readings may be at the end of the range
_CLIPPED_SHARE = 0.02  # of a sample in the mean that says how many were
_NO_TURNING = np.zeros((2, 3))
_FORCE_FAULTS = Fault.NOT_FINITE, Fault.STUCK, Fault.SATURATED
_RATE_FAULTS = Fault.RATE_NOT_FINITE, Fault.RATE_STUCK, Fault.RATE_SATURATED
_DOUBT_S = 0.1  # over which a doubt goes
# why gravity is not live, in the order of their sizes in `_judged`
_DOUBTS = (
    Fault.VIBRATION, Fault.UNCHECKED_TURN, Fault.NOT_FOLLOWED, Fault.RECOVERING, Fault.MAGNITUDE, Fault.SATURATED,
    Fault.DISAGREEMENT,
)  # fmt: skip


@dataclass(frozen=True)
class _Ages:
    """Ages of the newest sample [s]: held, given up, and without any sample at the start."""

    stale_after: float
    age_limit: float
    start_limit: float

    def __post_init__(self) -> None:
        if not 0.0 < self.stale_after <= self.age_limit < math.inf:
            raise InputError(
                f"stale_after {self.stale_after}, age_limit {self.age_limit}: expected 0 < stale_after <= age_limit [s]"
            )


class _FaultMemory:
    """The faults that showed of late, and when samples came, whatever they were worth."""

    def __init__(self) -> None:
        self._seen: dict[Fault, float] = {}  # when each showed last
        self._heard, self._dropped = -math.inf, 0

    def begin(self, dropped: int) -> None:
        """Forget the faults; of samples so many have been dropped before."""
        self._seen.clear()
        self._dropped = dropped

    def show(self, fault: Fault, time: float) -> None:
        """Take a fault that shows at a time [s]."""
        if fault is not Fault.NONE:
            self._seen[fault] = time

    def count_dropped(self, dropped: int, time: float) -> None:
        """Take how many samples a mailbox has dropped until a time [s]."""
        if dropped != self._dropped:
            self._dropped = dropped
            self.show(Fault.SAMPLES_LOST, time)

    def hear(self, time: float) -> None:
        """Take the time of a sample [s]."""
        self._heard = time

    def faults(self, time: float) -> Fault:
        """Return those of late."""
        if not self._seen:
            return Fault.NONE
        self._seen = {fault: seen for fault, seen in self._seen.items() if time - seen <= _FAULT_MEMORY_S}
        return reduce(or_, self._seen, Fault.NONE)

    def silence(self, time: float, begin: float, limit: float) -> Fault:
        """Return the fault of having heard nothing for longer than a limit [s]."""
        if time - self._heard <= limit or time - begin <= limit:
            return Fault.NONE
        return Fault.NOTHING_RECEIVED if self._heard == -math.inf else Fault.INTERRUPTED


class SensedGravity:
    """Gravity, angular velocity and angular acceleration of a base, from samples in a mailbox; a GravitySource.

    Each tick takes what came, checks it (checks.py), and reads now what filters of several memories make of it
    (Memories), which turn along with the gyroscope, so that neither filtering nor the wait between samples delays the
    reading, and vibration averages out. With p the sensor's position from the base's origin,

        gravity = gravity at the sensor + alpha x p + omega x (omega x p)

    in which gravity is free-fall acceleration, g minus the acceleration of that point. Rates of a gyroscope count once
    gravity was seen to turn with them (TurningWatch), or a tumble saw it; its bias is what it reads at rest
    (RestRate).

    Before anything is believed gravity is that of a level base (NOMINAL). What is measured is LIVE within 0.3 m/s2, and
    otherwise DEGRADED, with its deviation and a fault that says why. When samples stop or are all wrong, gravity is
    followed for a moment, then held (STALE); at the age limit the fallback takes its place: `hold` gravity as of the
    newest sample, `fade` to gravity along the mean direction of the last seconds, `static`, that of a level base, or
    `stop`, also when none was heard for a second. Angular terms end at the age limit in all of them. Nothing ever leaps
    (SmoothTransfer). `read` raises nothing.
    """

    def __init__(
        self,
        mailbox: Mailbox,
        mounting: Mounting | None = None,
        *,
        mounted_on: str | BaseSpectrum = "table",
        angular: bool = True,
        fallback: str = "fade",
        hanging: bool = False,
        stuck_samples: int = 10,
        stale_after: float = 0.05,
        age_limit: float = 0.2,
        attitude_time: float | None = None,
        start_limit: float = 1.0,
        feed: Callable[[float], None] | None = None,
    ) -> None:
        """Take samples from a mailbox.

        Args:
            mounting: At the base's origin, in its axes and without bias when None.
            mounted_on: table, cart, vehicle or ship, or how the base moves: how soon it is doubted, and settles.
            angular: A gyroscope is there; without, angular rates are left aside.
            fallback: hold, fade, static or stop.
            hanging: The base may hang upside down.
            stuck_samples: Identical readings in a row that make a sensor stuck; 0 for one without noise.
            stale_after: Age of the newest sample from which it counts as held [s].
            age_limit: Age from which the fallback takes its place [s].
            attitude_time: Time constant of the mean direction that `fade` goes to [s]; by `mounted_on` when None.
            start_limit: Time without any believed sample after which `stop` stops [s].
            feed: Called with the time before samples are taken: what has no thread of its own delivers then.
        """
        self._ages = _Ages(stale_after, age_limit, start_limit)
        base = base_spectrum(mounted_on)
        attitude = base.attitude_time if attitude_time is None else attitude_time
        for name, value in (("attitude_time", attitude), ("start_limit", start_limit)):
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: expected more than 0 s, got {value}")
        if fallback not in FALLBACKS:
            raise InputError(f'fallback "{fallback}": expected one of {", ".join(FALLBACKS)}')
        if not stuck_samples >= 0:
            raise InputError(f"stuck_samples: expected 0 or more, got {stuck_samples}")
        m = self.mounting = Mounting() if mounting is None else mounting
        self.mailbox, self._angular, self._fallback, self._feed = mailbox, angular, FALLBACKS[fallback], feed
        self._position, self._place = np.array(m.position), norm(m.position)
        self._force_raw = RawCheck(stuck_samples, m.acceleration_range, _FORCE_FAULTS)
        self._rate_raw = RawCheck(stuck_samples, m.rate_range, _RATE_FAULTS)
        self._check, self._rate_check = GravityCheck(base, lever=self._place, hanging=hanging), RateCheck()
        self._force, self._rates = Memories(_QUIET), Memories(_QUIET_RATE)
        self._rest, self._predicted = RestRate(PredictedGravity.STILL_RATE), PredictedGravity(base.push)
        drift = 0.5 * min(base.slow_acceleration, HIGH_PASS_S * base.slow_jerk)
        self._watch = TurningWatch(m.position @ m.rotation, drift, checked=m.checked)
        self._attitude = SlowAttitude(attitude)
        self._transfer = SmoothTransfer(np.array(_FOLLOWING), np.array(_RECOVERING))
        self._memory = _FaultMemory()
        self._believed = self._rate_heard = -math.inf  # [s] stamps of the newest reading that was believed, and rate
        self._gaps, self._sudden, self._ahead, self._doubted = 0, 0.0, 0.0, 0.0  # and [m/s2] gravity may have been off
        self._drift = _NO_TURNING[0]  # (3,) [rad/s] of the rates that are used, as turns show it
        self._mistaken = 0.0  # [m/s2] that gravity is off if the accelerometer's axes have changed
        self._clipped = 0.0  # samples of late that were at the end of the range
        self._at = np.zeros(
            (2, 3, 3)
        )  # value, slope and deviations as last read: of rates, and of gravity at the sensor
        self._held = LEVEL  # gravity as of the newest sample there was
        self._last_time, self._first_time = math.nan, math.nan
        self._said = ReadingStatus.NOMINAL
        self._transfer.follow(self._motion(0.0, turning=False), 0.0, changed=False)  # compiles it
        self._transfer.restart()
        self._mode: tuple[ReadingStatus, bool, int] = (ReadingStatus.NOMINAL, False, 0)

    def read(self, time: float) -> GravityReading:
        """Return gravity and the turning of the base at a time [s], on the clock of the samples' stamps."""
        if not math.isfinite(time):
            time = 0.0 if math.isnan(self._last_time) else self._last_time
        if not time - self._last_time < _PAUSE_S:
            self._begin(time)
        else:
            if self._feed is not None:
                self._feed(time)
            self._take(time, _MAX_SAMPLES_A_TICK)
        # angular terms are held with gravity, and given up at the age limit
        status = self._status(time)
        turning = self._rate_is_known and time - self._rates.newest <= self._ages.age_limit
        mode = status, turning, self._gaps
        changed, self._mode = mode != self._mode, mode
        dt = min(max(time - self._last_time, 0.0), 0.02)
        self._last_time = time
        moves = self._transfer.follow(self._target(time, status, turning), dt, changed=changed)
        faults, deviation = self._memory.faults(time), math.inf
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            status, reason, deviation = self._judged(time, status, turning, dt)
            if self._said is ReadingStatus.NOMINAL and reason is Fault.RECOVERING:
                status, reason, deviation = ReadingStatus.NOMINAL, Fault.NONE, math.inf  # on its way from a level base
            faults = faults if reason is Fault.NONE else faults | reason
        self._said = status
        silence = self._silences(time, status)
        faults = faults if silence is Fault.NONE else faults | silence
        ageless = status is ReadingStatus.NOMINAL or (
            status is ReadingStatus.FALLBACK and (self._fallback.gravity is None or self._believed == -math.inf)
        )
        age = math.inf if ageless else max(0.0, time - self._believed)
        return GravityReading(moves[0], age, moves[1:], status, faults, deviation)

    @property
    def remedy(self) -> str:
        """What mends a gyroscope that does not turn as gravity does, in words; empty where none was found wrong."""
        return self._watch.found.remedy

    def _begin(self, time: float) -> None:
        """Begin to be read, or again after a pause: what piled up meanwhile is no fault, and nothing is to be eased."""
        self._first_time = self._last_time = time
        if self._feed is not None:
            self._feed(time)
        self._take(time, len(self.mailbox))
        self._memory.begin(self.mailbox.dropped)
        self._transfer.restart()

    def _take(self, now: float, most: int) -> None:
        self._memory.count_dropped(self.mailbox.dropped, now)
        for _ in range(most):
            sample = self.mailbox.take()
            if sample is None:
                return
            self._memory.hear(now)
            turns = sample.kind is Kind.ANGULAR_RATE
            if turns and not self._angular:
                continue
            fault = (self._rate_raw if turns else self._force_raw).fault(sample.stamp, sample.vector, now)
            if fault is Fault.NONE and now - sample.stamp > self._ages.age_limit:
                fault = Fault.STAMP_OLD
            clipped = fault is Fault.SATURATED and self._force.noise > _SHAKES  # its end is nearer than what was before
            if fault is Fault.NONE or clipped:
                self._memory.show(fault, now)
                fault = self._take_rate(sample) if turns else self._take_force(sample)
            self._clipped += clipped - min(1.0, _CLIPPED_SHARE) * self._clipped if not turns else 0.0
            self._memory.show(fault, now)

    def _take_force(self, sample: SensorSample) -> Fault:
        stamp, vector, kind = sample
        check = self._check
        gravity = self.mounting.gravity(np.array(vector), kind)
        in_sensor = gravity @ self.mounting.rotation
        if self._predicted.disagrees:
            self._watch.add_gravity(
                stamp, in_sensor, (self._force.noise, self._rates.noise)
            )  # which of them is wrong may be found meanwhile
            if self._follows(stamp, gravity):
                return Fault.DISAGREEMENT
            self._meet_anew(stamp)
        # after a second without any sample; wrong ones keep their reason to be doubted
        if self._believed > -math.inf and _FORGET_AFTER_S < stamp - check.last_stamp < math.inf:
            check.forget()
            self._force.clear()
        rate, swing = None, 0.0
        if self._rate_is_fresh(stamp):
            rate, alpha, _ = self._rates.at(stamp)
            swing = max(0.0, norm(alpha) - _NOISY_SWING)
        expected = self._force.at(stamp, rate)[0]
        if self._force.newest > -math.inf:
            self._sudden = max(0.0, norm(gravity - expected) - _SUDDEN - 3.0 * self._force.noise)
        fault = check.fault(stamp, gravity, expected, None if rate is None else rate - self._drift, swing)
        if fault is not Fault.NONE or check.reference is None:
            return fault
        self._watch.add_gravity(stamp, in_sensor, (self._force.noise, self._rates.noise))
        if self._follows(stamp, gravity):
            return Fault.DISAGREEMENT
        self._believed, self._mistaken = stamp, self._watch.mistaken(in_sensor)
        self._held = self._motion(stamp, self._rate_is_known and self._rate_is_fresh(stamp))[0]
        self._attitude.add(stamp, self._held)
        return Fault.MAGNITUDE if check.is_long else Fault.NONE

    def _follows(self, stamp: float, gravity: Floats) -> bool:
        """Filter a reading; return whether the gyroscope contradicts what it says."""
        if stamp - self._force.newest > _GAP_S:
            self._force.clear()
            self._gaps += 1
        rate = self._rates.at(stamp)[0] if self._rate_is_fresh(stamp) else None
        self._force.add(stamp, gravity, rate)
        value, _, (deviation, *_) = self._force.at(stamp)
        if rate is not None and self._rate_is_known:
            value = value + lever(self._position, *self._rates.at(stamp)[:2])
        return self._predicted.compare(stamp, value, deviation)

    def _meet_anew(self, stamp: float) -> None:
        """Meet the accelerometer anew after a disagreement."""
        self._check.forget()
        self._force.clear()
        self._check.doubted_until = stamp + PredictedGravity.DRAW

    def _take_rate(self, sample: SensorSample) -> Fault:
        stamp, vector, _ = sample
        rest, check = self._rest, self._check
        self._rate_heard = stamp
        read = self.mounting.rate(np.array(vector))
        steady = check.is_steady and stamp - check.last_stamp < 2.0 * GravityCheck.GAP
        rest.add(stamp, read, check.mean if steady else None)
        fitted = self._watch.fitted_bias
        fitted = None if fitted is None else self.mounting.rotation @ fitted
        self._drift = _NO_TURNING[0] if rest.is_known or fitted is None else fitted
        rate = read - rest.bias
        self._watch.bias = rest.bias @ self.mounting.rotation if rest.is_known else None
        self._watch.add_rate(stamp, read @ self.mounting.rotation)
        fault = self._rate_check.fault(rate, self._rates.at(stamp)[0] if self._rate_is_fresh(stamp) else None)
        if self._rate_check.leapt:
            self._watch.doubt()
        wrong = self._watch.found.fault
        if wrong is fault is Fault.NONE and rest.is_in_degrees:
            wrong = Fault.RATE_UNIT
        if wrong is not Fault.NONE:
            # it foretells nothing, and what it said is not used any more
            if self._predicted.disagrees:
                self._meet_anew(stamp)
            self._predicted.forget()
            self._rates.add(stamp, rate)  # they still say how far gravity may be off
            return wrong
        if fault is Fault.RATE_TOO_FAST:
            self._predicted.forget()  # whatever it is, it does not say that the base stands still
        elif fault in (Fault.NONE, Fault.RATE_SPIKE):  # nor does a base say so that begins to turn at once
            self._predicted.turn(stamp, read, rest.bias if rest.is_known else None, fitted)
        if fault is not Fault.NONE or not self._rate_check.believed:
            return fault
        if self._predicted.disagrees:
            return Fault.DISAGREEMENT
        dt = stamp - self._rates.newest
        if dt > _GAP_S:
            self._rates.clear()
        if dt <= self._ages.age_limit and self._rate_is_known:
            self._attitude.turn(dt * rate)
        self._rates.add(stamp, rate)
        return Fault.NONE

    def _rate_is_fresh(self, time: float) -> bool:
        is_right = self._watch.found.fault is Fault.NONE
        return is_right and time - self._rates.newest <= self._ages.stale_after

    @property
    def _rate_is_known(self) -> bool:
        """Return whether rates are there, and were found to turn as gravity does, or by what leaves it where it is."""
        return self._watch.may_be_used and self._rates.span >= _RATES_S

    def _status(self, time: float) -> ReadingStatus:
        stops = self._fallback.stops
        fallen = ReadingStatus.STOP if stops else ReadingStatus.FALLBACK
        if self._believed == -math.inf:
            started = not stops or time - self._first_time <= self._ages.start_limit
            return ReadingStatus.NOMINAL if self._mode[0] is ReadingStatus.NOMINAL and started else fallen
        age = time - self._believed
        if age <= self._ages.stale_after and not self._predicted.disagrees:
            return ReadingStatus.LIVE
        return ReadingStatus.STALE if age <= self._ages.age_limit else fallen

    def _judged(
        self, time: float, status: ReadingStatus, turning: bool, dt: float
    ) -> tuple[ReadingStatus, Fault, float]:
        """Return what gravity that is measured is worth, why it is not live, and its deviation [m/s2]."""
        deviation = float(self._at[1, 2, 0])
        lasting = math.exp(-dt / _DOUBT_S)
        self._doubted = max(self._doubt(time, turning), self._doubted * lasting)
        self._ahead = max(self._sudden, self._ahead * lasting)
        doubts = (
            2.0 * math.sqrt(3.0) * deviation, self._doubted, self._ahead, self._transfer.behind, self._check.length_off,
            self._force.noise * min(1.0, _CLIPPED_SHARE * self._clipped), max(self._predicted.apart, self._mistaken),
        )  # fmt: skip
        reason, total = Fault.NONE, sum(doubts)
        if status is ReadingStatus.LIVE and total > _LIVE_WITHIN:
            status, reason = ReadingStatus.DEGRADED, _DOUBTS[doubts.index(max(doubts))]
        elif status is ReadingStatus.LIVE and self._check.last_stamp > self._believed:
            status = ReadingStatus.STALE  # the last reading was not believed
        return status, reason, total / (2.0 * math.sqrt(3.0))

    def _target(self, time: float, status: ReadingStatus, turning: bool) -> Floats:
        """Return where gravity, angular velocity and angular acceleration should be, (3, 3)."""
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            return self._motion(time, turning)
        gravity = LEVEL
        if status is not ReadingStatus.NOMINAL and self._fallback.gravity is not None:
            gravity = self._fallback.gravity(self)
        return np.array([gravity, *_NO_TURNING])

    def newest_gravity(self) -> Floats:
        """Return gravity (3,) as of the newest sample: a parabola's guess of later is noisier; level before any."""
        return self._held

    def mean_gravity(self) -> Floats:
        """Return gravity (3,) along its mean direction of the last seconds."""
        return self._attitude.gravity()

    def _motion(self, time: float, turning: bool) -> Floats:
        """Return gravity at the base's origin, angular velocity and acceleration at a time [s], (3, 3)."""
        out, force, rates = np.empty((3, 3)), self._force, self._rates
        motion(
            force.state, rates.state, time - force.newest, time - rates.newest, turning, self._position,
            self._at, out,
        )  # fmt: skip
        return out

    def _doubt(self, time: float, turning: bool) -> float:
        """Return how far gravity may be off by a turn that is not, or not yet, accounted for [m/s2].

        Of what `_motion` found at the same time.
        """
        place = self._place
        if place == 0.0:
            return 0.0
        unused = 0.0
        rates, force = self._at
        if time - self._rates.newest <= self._ages.stale_after:
            if turning:
                rate, change = rates[2].tolist()[:2]
                return 4.0 * place * (math.sqrt(2.0) * change + 2.0 * norm(rates[0]) * rate)
            omega, alpha, _ = self._rates.at(time)
            unused = norm(lever(self._position, omega, alpha))  # they may be right
        # what moved gravity may be the lever alone, as of a turn about the vertical, or a turn with what it does there
        moves = max(0.0, norm(force[1]) - 5.0 * float(force[2, 1]))
        own = moves / STANDARD_GRAVITY
        return max(unused, min(1.25 * _OWN_S * moves, place * (own * own + own / _BEGINNING_S)))

    def _silences(self, time: float, status: ReadingStatus) -> Fault:
        """Return the faults of having heard nothing."""
        limit = self._ages.stale_after
        if status not in (ReadingStatus.LIVE, ReadingStatus.DEGRADED):
            return self._memory.silence(time, self._first_time, limit)
        return Fault.RATES_INTERRUPTED if self._angular and time - self._rate_heard > limit else Fault.NONE
