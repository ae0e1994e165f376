"""Gravity vector of a moving base from an IMU: accelerometer, with or without gyroscope, filters and fault handling."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.fading_filters import Memories, lever, motion
from catenary.sensing.fallback import SlowAttitude, SmoothTransfer
from catenary.sensing.fallback_kinds import FALLBACKS
from catenary.sensing.gravity_vector import GravityReading, Kind, Mailbox, ReadingStatus, SensorSample
from catenary.sensing.gyro_evidence import HIGH_PASS_S
from catenary.sensing.gyro_hypotheses import TurningWatch
from catenary.sensing.gyro_prediction import PredictedGravity, RestRate
from catenary.sensing.imu_faults import Fault, GravityCheck, RateCheck, RawCheck, norm
from catenary.sensing.mounting import Mounting
from catenary.sensing.platforms import BaseSpectrum, base_spectrum
from catenary.spatial import LEVEL, STANDARD_GRAVITY

# rate limits of gravity, angular velocity and angular acceleration of the base [m/s3, rad/s2, rad/s3]: ten times those
# of rocking by 10 degrees at 1 Hz; and the rates at which they recover from a fault
_FOLLOWING = (100.0, 50.0, 400.0)
_RECOVERING = (10.0, 5.0, 40.0)
_MAX_SAMPLES_A_TICK = 64  # bounds the duration of a tick when samples have queued up
_FAULT_MEMORY_S = 0.1  # a fault is reported for this long after its sample
_PAUSE_S = 0.5  # a longer pause between reads restarts the reading
_FORGET_AFTER_S = 1.0  # a longer time without samples discards a sensor's history
_LIVE_ERROR = 0.3  # [m/s2] largest error of live gravity: two deviations, unchecked turns, recovery
_MIN_NOISE, _MIN_RATE_NOISE = 1e-3, 1e-5  # [m/s2, rad/s] of a sample
_GAP_S = 0.25  # no parabola is fitted across a longer time without samples
_MIN_RATE_SPAN_S = 0.04  # of rates from which an angular acceleration is computed
_NOISY_SWING = 2.0  # [rad/s2] of angular acceleration, attributed to noise
_MAX_INNOVATION = 0.3  # [m/s2] between a reading and its prediction, attributed to noise
_TURN_S, _TURN_START_S = 0.2, 0.04  # longest time until gravity's slope shows a rotation, and of a rotation's start
_SHAKING_NOISE = 0.5  # [m/s2] of vibration in which single readings may saturate
_CLIPPED_SHARE = 0.02  # weight of a sample in the mean number of saturated ones
_NO_TURNING = np.zeros((2, 3))
_FORCE_FAULTS = Fault.NOT_FINITE, Fault.STUCK, Fault.SATURATED
_RATE_FAULTS = Fault.RATE_NOT_FINITE, Fault.RATE_STUCK, Fault.RATE_SATURATED
_DOUBT_S = 0.1  # time constant with which a doubt decays
# reasons why gravity is not live, in the order of their sizes in `_assess`
_DOUBTS = (
    Fault.VIBRATION, Fault.UNCHECKED_TURN, Fault.NOT_FOLLOWED, Fault.RECOVERING, Fault.MAGNITUDE, Fault.SATURATED,
    Fault.DISAGREEMENT,
)  # fmt: skip


@dataclass(frozen=True)
class _Ages:
    """Age limits of the newest sample [s]: held, replaced by the fallback, and waiting for the first sample."""

    stale_after: float
    age_limit: float
    start_limit: float

    def __post_init__(self) -> None:
        if not 0.0 < self.stale_after <= self.age_limit < math.inf:
            raise InputError(
                f"stale_after {self.stale_after}, age_limit {self.age_limit}: expected 0 < stale_after <= age_limit [s]"
            )


class _FaultMemory:
    """Recent faults, and the time of the newest sample, accepted or not."""

    def __init__(self) -> None:
        self._seen: dict[Fault, float] = {}  # time of each fault's last sample
        self._received, self._dropped = -math.inf, 0

    def begin(self, dropped: int) -> None:
        self._seen.clear()
        self._dropped = dropped

    def show(self, fault: Fault, time: float) -> None:
        if fault is not Fault.NONE:
            self._seen[fault] = time

    def count_dropped(self, dropped: int, time: float) -> None:
        if dropped != self._dropped:
            self._dropped = dropped
            self.show(Fault.SAMPLES_LOST, time)

    def receive(self, time: float) -> None:
        self._received = time

    def faults(self, time: float) -> Fault:
        if not self._seen:
            return Fault.NONE
        self._seen = {fault: seen for fault, seen in self._seen.items() if time - seen <= _FAULT_MEMORY_S}
        return reduce(or_, self._seen, Fault.NONE)

    def silence(self, time: float, begin: float, limit: float) -> Fault:
        """Return the fault of receiving no sample for longer than a limit [s]."""
        if time - self._received <= limit or time - begin <= limit:
            return Fault.NONE
        return Fault.NOTHING_RECEIVED if self._received == -math.inf else Fault.INTERRUPTED


class SensedGravity:
    """Estimate gravity, angular velocity and angular acceleration of a base from an IMU; a GravitySource.

    Each tick takes new samples from a mailbox, checks them (imu_faults.py), and evaluates filters of several memories
    (Memories) at the present time. The filters rotate with the gyroscope, so that filtering and the sample interval add
    no delay, and vibration averages out. With p the sensor's position from the base's origin,

        gravity = gravity at the sensor + alpha x p + omega x (omega x p)

    where gravity is free-fall acceleration, g minus the acceleration of that point. A gyroscope is used once gravity
    has turned with it (TurningWatch), or a tumble has confirmed it; its bias is its reading at rest (RestRate).

    Before the first accepted sample gravity is that of a level base (NOMINAL). Measured gravity is LIVE within 0.3 m/s2
    and otherwise DEGRADED, with its deviation and the fault. When samples stop or are all rejected, gravity is
    extrapolated briefly, then held (STALE); at the age limit the fallback replaces it: `hold`, gravity at the newest
    sample; `fade`, gravity along the mean direction of the last seconds; `static`, that of a level base; or `stop`,
    also if no sample is accepted within the start limit. Angular terms end at the age limit. Transitions are
    rate-limited (SmoothTransfer). `read` raises nothing.
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
        """Configure the sensor, its checks and its fallback.

        Args:
            mailbox: Source of samples, in the sensor's axes and SI.
            mounting: Position, rotation and biases; at the base's origin, in its axes and without bias when None.
            mounted_on: table, cart, vehicle or ship, or a spectrum: sets thresholds and averaging times.
            angular: Use the gyroscope's samples; ignore them otherwise.
            fallback: hold, fade, static or stop.
            hanging: Accept a base that hangs upside down.
            stuck_samples: Consecutive identical readings of a stuck sensor; 0 for a sensor without noise.
            stale_after: Age of the newest sample from which gravity is held [s], positive.
            age_limit: Age from which the fallback replaces it [s], at least `stale_after`.
            attitude_time: Averaging time of the direction that `fade` converges to [s]; by `mounted_on` when None.
            start_limit: Time without an accepted sample after which `stop` stops the robot [s].
            feed: Called with the time before each read, so that a sensor without a thread can deliver samples.
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
        self._force, self._rates = Memories(_MIN_NOISE), Memories(_MIN_RATE_NOISE)
        self._rest_rate, self._predicted = RestRate(PredictedGravity.STILL_RATE), PredictedGravity(base.push)
        drift = 0.5 * min(base.slow_acceleration, HIGH_PASS_S * base.slow_jerk)
        self._watch = TurningWatch(m.position @ m.rotation, drift, checked=m.checked)
        self._attitude = SlowAttitude(attitude)
        self._transfer = SmoothTransfer(np.array(_FOLLOWING), np.array(_RECOVERING))
        self._memory = _FaultMemory()
        self._believed = self._rate_received = -math.inf  # [s] stamps of the newest accepted reading, and rate
        self._gaps, self._sudden, self._ahead, self._doubted = 0, 0.0, 0.0, 0.0  # and possible errors [m/s2]
        self._drift = _NO_TURNING[0]  # (3,) [rad/s] bias of the rates, fitted in turns
        self._mistaken = 0.0  # [m/s2] error of gravity if the accelerometer's axes were changed
        self._clipped = 0.0  # mean number of saturated samples
        # latest value, slope and deviations of the rates, and of gravity at the sensor
        self._at = np.zeros((2, 3, 3))
        self._held = LEVEL  # gravity at the newest sample
        self._last_time, self._first_time = math.nan, math.nan
        self._reported = ReadingStatus.NOMINAL
        self._transfer.follow(self._motion(0.0, turning=False), 0.0, changed=False)  # compiles it
        self._transfer.restart()
        self._mode: tuple[ReadingStatus, bool, int] = (ReadingStatus.NOMINAL, False, 0)

    def read(self, time: float) -> GravityReading:
        """Return gravity, angular velocity and acceleration of the base at a time [s] of the stamps' clock."""
        if not math.isfinite(time):
            time = 0.0 if math.isnan(self._last_time) else self._last_time
        if not time - self._last_time < _PAUSE_S:
            self._begin(time)
        else:
            if self._feed is not None:
                self._feed(time)
            self._take(time, _MAX_SAMPLES_A_TICK)
        # angular terms are held with gravity, and end at the age limit
        status = self._status(time)
        turning = self._rate_is_known and time - self._rates.newest <= self._ages.age_limit
        mode = status, turning, self._gaps
        changed, self._mode = mode != self._mode, mode
        dt = min(max(time - self._last_time, 0.0), 0.02)
        self._last_time = time
        moves = self._transfer.follow(self._target(time, status, turning), dt, changed=changed)
        faults, deviation = self._memory.faults(time), math.inf
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            status, reason, deviation = self._assess(time, status, turning, dt)
            if self._reported is ReadingStatus.NOMINAL and reason is Fault.RECOVERING:
                status, reason, deviation = ReadingStatus.NOMINAL, Fault.NONE, math.inf  # on its way from a level base
            faults = faults if reason is Fault.NONE else faults | reason
        self._reported = status
        silence = self._silence_faults(time, status)
        faults = faults if silence is Fault.NONE else faults | silence
        ageless = status is ReadingStatus.NOMINAL or (
            status is ReadingStatus.FALLBACK and (self._fallback.gravity is None or self._believed == -math.inf)
        )
        age = math.inf if ageless else max(0.0, time - self._believed)
        return GravityReading(moves[0], age, moves[1:], status, faults, deviation)

    @property
    def remedy(self) -> str:
        """Correction of a gyroscope that contradicts gravity, as text; empty if no fault was found."""
        return self._watch.result.remedy

    def _begin(self, time: float) -> None:
        """Start reading, or restart after a pause: queued samples are no fault, and no transfer is smoothed."""
        self._first_time = self._last_time = time
        if self._feed is not None:
            self._feed(time)
        self._take(time, len(self.mailbox))
        self._memory.begin(self.mailbox.dropped)
        self._transfer.restart()

    def _take(self, now: float, max_samples: int) -> None:
        self._memory.count_dropped(self.mailbox.dropped, now)
        for _ in range(max_samples):
            sample = self.mailbox.take()
            if sample is None:
                return
            self._memory.receive(now)
            turns = sample.kind is Kind.ANGULAR_RATE
            if turns and not self._angular:
                continue
            fault = (self._rate_raw if turns else self._force_raw).fault(sample.stamp, sample.vector, now)
            if fault is Fault.NONE and now - sample.stamp > self._ages.age_limit:
                fault = Fault.STAMP_OLD
            # under vibration a saturated reading is closer to the truth than an older one
            clipped = fault is Fault.SATURATED and self._force.shaking > _SHAKING_NOISE
            if fault is Fault.NONE or clipped:
                self._memory.show(fault, now)
                fault = self._take_rate(sample) if turns else self._take_force(sample)
            self._clipped += clipped - min(1.0, _CLIPPED_SHARE) * self._clipped if not turns else 0.0
            self._memory.show(fault, now)

    def _take_force(self, sample: SensorSample) -> Fault:
        stamp, check = sample.stamp, self._check
        rate, swing = None, 0.0
        if self._rate_is_fresh(stamp):
            rate, alpha, _ = self._rates.at(stamp)
            swing = max(0.0, norm(alpha) - _NOISY_SWING)
        expected, vibration = self._force.ahead(stamp, rate)
        gravity = self._unclipped(sample, expected + vibration)
        is_shaken = norm(gravity - vibration - expected) < norm(gravity - expected)
        calm = gravity - vibration if is_shaken else gravity
        in_sensor = calm @ self.mounting.rotation
        if self._predicted.disagrees:
            # this may show which sensor is wrong
            self._watch.add_gravity(stamp, in_sensor, (self._force.noise, self._rates.noise))
            if self._follows(stamp, gravity):
                return Fault.DISAGREEMENT
            self._reset_accelerometer(stamp)
        # only after a second without any sample: rejected samples keep the history
        if self._believed > -math.inf and _FORGET_AFTER_S < stamp - check.last_stamp < math.inf:
            check.forget()
            self._force.clear()
        if self._force.newest > -math.inf:
            self._sudden = max(0.0, norm(calm - expected) - _MAX_INNOVATION - 3.0 * self._force.noise)
        fault = check.fault(stamp, calm, expected, None if rate is None else rate - self._drift, swing)
        if fault is not Fault.NONE or check.reference is None:
            return fault
        self._watch.add_gravity(stamp, in_sensor, (self._force.noise, self._rates.noise))
        if self._follows(stamp, gravity):
            return Fault.DISAGREEMENT
        self._believed, self._mistaken = stamp, self._watch.mistaken(in_sensor)
        self._held = self._motion(stamp, self._rate_is_known and self._rate_is_fresh(stamp))[0]
        self._attitude.add(stamp, self._held)
        return Fault.MAGNITUDE if check.is_long else Fault.NONE

    def _unclipped(self, sample: SensorSample, expected: Floats) -> Floats:
        """Return gravity (3,) of a reading; of axes at the end of their range what is expected (3,) beyond it."""
        reading, kind = np.array(sample.vector), sample.kind
        if max(map(abs, sample.vector)) >= self._force_raw.end:
            beyond = self.mounting.reading(expected, kind)
            clipped = (np.abs(reading) >= self._force_raw.end) & (beyond * np.sign(reading) > np.abs(reading))
            reading = np.where(clipped, beyond, reading)
        return self.mounting.gravity(reading, kind)

    def _follows(self, stamp: float, gravity: Floats) -> bool:
        """Filter a reading; return true if the gyroscope contradicts it."""
        if stamp - self._force.newest > _GAP_S:
            self._force.clear()
            self._gaps += 1
        rate = self._rates.at(stamp)[0] if self._rate_is_fresh(stamp) else None
        self._force.add(stamp, gravity, rate)
        value, _, (deviation, *_) = self._force.at(stamp)
        if rate is not None and self._rate_is_known:
            value = value + lever(self._position, *self._rates.at(stamp)[:2])
        return self._predicted.compare(stamp, value, deviation)

    def _reset_accelerometer(self, stamp: float) -> None:
        self._check.forget()
        self._force.clear()
        self._check.doubted_until = stamp + PredictedGravity.DRAW

    def _take_rate(self, sample: SensorSample) -> Fault:
        stamp, vector, _ = sample
        rest_rate, check = self._rest_rate, self._check
        self._rate_received = stamp
        read = self.mounting.rate(np.array(vector))
        steady = check.is_steady and stamp - check.last_stamp < 2.0 * GravityCheck.GAP
        rest_rate.add(stamp, read, check.mean if steady else None)
        fitted = self._watch.fitted_bias
        fitted = None if fitted is None else self.mounting.rotation @ fitted
        self._drift = _NO_TURNING[0] if rest_rate.is_known or fitted is None else fitted
        rate = read - rest_rate.bias
        rested = rest_rate.bias @ self.mounting.rotation if rest_rate.is_known else None
        self._watch.add_rate(stamp, read @ self.mounting.rotation, rested)
        fault = self._rate_check.fault(rate, self._rates.at(stamp)[0] if self._rate_is_fresh(stamp) else None)
        if self._rate_check.leapt:
            self._watch.doubt()
        wrong = self._watch.result.fault
        if wrong is fault is Fault.NONE and rest_rate.is_in_degrees:
            wrong = Fault.RATE_UNIT
        if wrong is not Fault.NONE:
            # its predictions are discarded
            if self._predicted.disagrees:
                self._reset_accelerometer(stamp)
            self._predicted.forget()
            self._rates.add(stamp, rate)  # still bounds the error of gravity
            return wrong
        if fault is Fault.RATE_TOO_FAST:
            self._predicted.forget()  # it is no evidence of a base at rest
        elif fault in (Fault.NONE, Fault.RATE_SPIKE):  # a spike may be the start of a fast turn
            self._predicted.turn(stamp, read, rest_rate.bias if rest_rate.is_known else None, fitted)
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
        is_right = self._watch.result.fault is Fault.NONE
        return is_right and time - self._rates.newest <= self._ages.stale_after

    @property
    def _rate_is_known(self) -> bool:
        """Rates are available and confirmed, or at least not contradicted by gravity."""
        return self._watch.may_be_used and self._rates.span >= _MIN_RATE_SPAN_S

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

    def _assess(
        self, time: float, status: ReadingStatus, turning: bool, dt: float
    ) -> tuple[ReadingStatus, Fault, float]:
        """Return the status of measured gravity, the fault that keeps it from being live, and its deviation [m/s2]."""
        variance = 3.0 * float(self._at[1, 2, 0]) ** 2  # of the three axes
        if turning:  # of alpha x p and omega x (omega x p), which lag: three deviations in place of two
            rate, change = self._at[0, 2, :2].tolist()
            variance += 2.25 * self._place**2 * (2.0 * change**2 + (2.0 * norm(self._at[0, 0]) * rate) ** 2)
        lasting = math.exp(-dt / _DOUBT_S)
        self._doubted = max(self._doubt(time, turning), self._doubted * lasting)
        self._ahead = max(self._sudden, self._ahead * lasting)
        doubts = (
            2.0 * math.sqrt(variance), self._doubted, self._ahead, self._transfer.behind, self._check.length_off,
            self._force.noise * min(1.0, _CLIPPED_SHARE * self._clipped), max(self._predicted.apart, self._mistaken),
        )  # fmt: skip
        reason, total = Fault.NONE, sum(doubts)
        if status is ReadingStatus.LIVE and total > _LIVE_ERROR:
            status, reason = ReadingStatus.DEGRADED, _DOUBTS[doubts.index(max(doubts))]
        elif status is ReadingStatus.LIVE and self._check.last_stamp > self._believed:
            status = ReadingStatus.STALE  # the last reading was rejected
        return status, reason, total / (2.0 * math.sqrt(3.0))

    def _target(self, time: float, status: ReadingStatus, turning: bool) -> Floats:
        """Return the target of gravity, angular velocity and angular acceleration (3, 3), by status."""
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            return self._motion(time, turning)
        gravity = LEVEL
        if status is not ReadingStatus.NOMINAL and self._fallback.gravity is not None:
            gravity = self._fallback.gravity(self)
        return np.array([gravity, *_NO_TURNING])

    def newest_gravity(self) -> Floats:
        """Return gravity (3,) [m/s2] at the newest sample, less noisy than extrapolated; level before the first."""
        return self._held

    def mean_gravity(self) -> Floats:
        """Return gravity (3,) [m/s2] along the mean direction of the last seconds."""
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
        """Return the possible error of gravity by an unmodelled turn [m/s2], at the time of the last `_motion`."""
        place = self._place
        if place == 0.0:
            return 0.0
        unused, force = 0.0, self._at[1]
        if time - self._rates.newest <= self._ages.stale_after:
            if turning:
                return 0.0
            omega, alpha, _ = self._rates.at(time)
            unused = norm(lever(self._position, omega, alpha))  # unconfirmed rates may be right
        # gravity's slope may come from the lever arm alone, as in a turn about the vertical, or from a tilt
        moves = max(0.0, norm(force[1]) - 5.0 * float(force[2, 2]))
        own = moves / STANDARD_GRAVITY
        return max(unused, min(1.25 * _TURN_S * moves, place * (own * own + own / _TURN_START_S)))

    def _silence_faults(self, time: float, status: ReadingStatus) -> Fault:
        limit = self._ages.stale_after
        if status not in (ReadingStatus.LIVE, ReadingStatus.DEGRADED):
            return self._memory.silence(time, self._first_time, limit)
        return Fault.RATES_INTERRUPTED if self._angular and time - self._rate_received > limit else Fault.NONE
