"""The gravity vector from an accelerometer, or from an accelerometer and a gyroscope, on the robot's base."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import or_

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.agreement import AgreementWatch
from catenary.sensing.bases import BaseSpectrum, base_spectrum
from catenary.sensing.checks import Fault, GravityCheck, SensorRules, norm, rules_for
from catenary.sensing.fallback import SlowAttitude, SmoothTransfer
from catenary.sensing.fallbacks import FALLBACKS
from catenary.sensing.gyro_prediction import PredictedGravity
from catenary.sensing.mounting import Mounting
from catenary.sensing.tracks import GravityTrack, RateTrack
from catenary.sensing.vector import GravityReading, Kind, Mailbox, ReadingStatus, SensorSample
from catenary.spatial import LEVEL, cross

# how fast gravity, angular velocity and acceleration of the base may change as measured [m/s3, rad/s2, rad/s3]:
# ten times what rocking by 10 degrees at 1 Hz takes; and how fast they come back from a fault
_FOLLOWING = (100.0, 50.0, 400.0)
_RECOVERING = (10.0, 5.0, 40.0)
_MAX_SAMPLES_A_TICK = 64  # a queue that built up does not hold the tick up
_FAULT_MEMORY_S = 0.1  # for which a fault is reported after the sample that showed it
_PAUSE_S = 0.5  # between reads, after which they begin anew
_FORGET_AFTER_S = 1.0  # without samples, after which a sensor is met anew
_MAX_EASED = 0.3  # [m/s2] by which a reading that is live may be off, by its way from a fallback and by turning
_DOUBT_S = 0.1  # over which a doubt goes


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
        return reduce(or_, (fault for fault, seen in self._seen.items() if time - seen <= _FAULT_MEMORY_S), Fault.NONE)

    def silence(self, time: float, begin: float, limit: float) -> Fault:
        """Return the fault of having heard nothing for longer than a limit [s]."""
        if time - self._heard <= limit or time - begin <= limit:
            return Fault.NONE
        return Fault.NOTHING_RECEIVED if self._heard == -math.inf else Fault.INTERRUPTED


class SensedGravity:
    """Gravity, angular velocity and angular acceleration of a base, from samples in a mailbox; a GravitySource.

    Each tick takes what came, checks it (checks.py), fits a parabola through the last few samples of each kind
    (DelayFreeFilter) and reads it now, so that neither filtering nor the wait between samples delays the reading. With
    p the sensor's position from the base's origin,

        gravity = gravity at the sensor + alpha x p + omega x (omega x p)

    in which gravity is free-fall acceleration, g minus the acceleration of that point. Rates of a gyroscope count once
    gravity was seen to turn with them (AgreementWatch), or a tumble saw it; its bias is what it reads at rest
    (RestRate).

    Before anything is believed gravity is that of a level base (NOMINAL). When samples stop or are all wrong, the
    parabola is followed for a moment, then held (STALE); at the age limit the fallback takes its place: `hold`
    gravity as of the newest sample, `fade` to gravity along the mean direction of the last seconds, `static`, that
    of a level base, or `stop`, also when none was heard for a second. Angular terms end at the age limit in all of
    them. Nothing ever leaps (SmoothTransfer); on its way from one to the other, where the filter is behind the
    readings, where the last one was not believed, and where a turn may make more of the sensor's place, gravity is not
    live. `read` raises nothing.
    """

    def __init__(
        self,
        mailbox: Mailbox,
        mounting: Mounting | None = None,
        *,
        mounted_on: str | BaseSpectrum = "table",
        angular: bool = True,
        fallback: str = "fade",
        cutoff_hz: float | None = None,
        stale_after: float = 0.05,
        age_limit: float = 0.2,
        attitude_time: float | None = None,
        start_limit: float = 1.0,
        rules: SensorRules | None = None,
        feed: Callable[[float], None] | None = None,
    ) -> None:
        """Take samples from a mailbox.

        Args:
            mounting: At the base's origin, in its axes and without bias when None.
            mounted_on: table, cart, vehicle or ship, or how the base moves: gives what is None below.
            angular: A gyroscope is there; without, angular rates are left aside.
            fallback: hold, fade, static or stop.
            cutoff_hz: Half power of the low-pass; lower where fewer than five samples lie in 2.5 / cutoff_hz seconds.
            stale_after: Age of the newest sample from which it counts as held [s].
            age_limit: Age from which the fallback takes its place [s].
            attitude_time: Time constant of the mean direction that `fade` goes to [s].
            start_limit: Time without any believed sample after which `stop` stops [s].
            feed: Called with the time before samples are taken: what has no thread of its own delivers then.
        """
        self._ages = _Ages(stale_after, age_limit, start_limit)
        spectrum = base_spectrum(mounted_on)
        attitude = spectrum.attitude_time if attitude_time is None else attitude_time
        cutoff = spectrum.cutoff_hz if cutoff_hz is None else cutoff_hz
        for name, value in (("attitude_time", attitude), ("start_limit", start_limit)):
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: expected more than 0 s, got {value}")
        if fallback not in FALLBACKS:
            raise InputError(f'fallback "{fallback}": expected one of {", ".join(FALLBACKS)}')
        self.mailbox, self.mounting = mailbox, Mounting() if mounting is None else mounting
        self._angular, self._fallback, self._feed = angular, FALLBACKS[fallback], feed
        rules = rules_for(mounted_on) if rules is None else rules
        m = self.mounting
        self._force, self._rate = GravityTrack(rules, m, cutoff), RateTrack(rules, m, cutoff)
        self._predicted = PredictedGravity(rules)
        self._agreement = AgreementWatch(rules, m.position @ m.rotation, checked=m.checked)
        self._attitude = SlowAttitude(attitude)
        self._transfer = SmoothTransfer(np.array(_FOLLOWING), np.array(_RECOVERING))
        self._memory = _FaultMemory()
        self._doubted = 0.0  # [m/s2] by which gravity may have been off of late
        self._held = LEVEL  # gravity as of the newest sample there was
        self._last_time, self._first_time = math.nan, math.nan
        self._mode: tuple[ReadingStatus, bool, int] = (ReadingStatus.NOMINAL, False, 0)
        self._said = ReadingStatus.NOMINAL

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
        force, rate, limit = self._force.filter, self._rate.filter, self._ages.age_limit
        # angular terms are held with gravity, and given up at the age limit
        status, turning = self._status(time), self._rate_is_known and time - rate.newest <= limit
        mode = status, turning, self._force.gaps
        changed, self._mode = mode != self._mode, mode
        dt = min(max(time - self._last_time, 0.0), 0.02)
        self._last_time = time
        gravity, *rates = self._transfer.follow(self._target(time, status, turning), dt, changed=changed)
        self._doubted = max(self._doubt(time, turning), self._doubted * math.exp(-dt / _DOUBT_S))
        is_behind = self._transfer.behind + self._doubted > _MAX_EASED or self._force.is_ahead
        is_behind |= self._force.check.last_stamp > force.newest  # the last reading was not believed
        if status is not ReadingStatus.LIVE or not is_behind:
            self._said = status
        elif self._said is ReadingStatus.LIVE:
            self._said = ReadingStatus.STALE
        said = self._said
        ageless = ReadingStatus.NOMINAL, *((ReadingStatus.FALLBACK,) if self._fallback.gravity is None else ())
        age = math.inf if said in ageless or force.newest == -math.inf else max(0.0, time - force.newest)
        return GravityReading(gravity, age, np.array(rates), said, self._faults(time, status))

    @property
    def remedy(self) -> str:
        """What mends a gyroscope that does not turn as gravity does, in words; empty where none was found wrong."""
        return self._agreement.found.remedy

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
            fault = (self._rate if turns else self._force).raw.fault(sample.stamp, sample.vector, now)
            if fault is Fault.NONE and now - sample.stamp > self._ages.age_limit:
                fault = Fault.STAMP_OLD
            if fault is Fault.NONE:
                fault = self._take_rate(sample) if turns else self._take_force(sample)
            self._memory.show(fault, now)

    def _take_force(self, sample: SensorSample) -> Fault:
        stamp, vector, kind = sample
        force, check = self._force, self._force.check
        gravity = self.mounting.gravity(np.array(vector), kind)
        in_sensor = gravity @ self.mounting.rotation
        if self._predicted.disagrees:
            self._agreement.add_gravity(stamp, in_sensor)  # which of them is wrong may be found meanwhile
            if self._predicted.compare(stamp, gravity):
                return Fault.DISAGREEMENT
            self._meet_anew(stamp)
        # after a second without any sample; wrong ones keep their reason to be doubted
        if force.filter.newest > -math.inf and stamp - check.last_stamp > _FORGET_AFTER_S:
            force.meet_anew()
        rate = self._rate.filter.at(stamp)[0] if self._rate_is_fresh(stamp) else None
        fault = force.fault(stamp, gravity, rate, 0.0 if rate is None else self._rate.swing(stamp))
        if fault is not Fault.NONE or check.reference is None:
            return fault
        self._agreement.add_gravity(stamp, in_sensor)
        known = rate is not None and self._rate_is_known
        if self._predicted.compare(stamp, gravity + self._lever(*self._turning(stamp)) if known else gravity):
            return Fault.DISAGREEMENT
        force.add(stamp, gravity)
        if force.is_ahead:
            self._memory.show(Fault.NOT_FOLLOWED, stamp)
        self._attitude.add(stamp, gravity)
        return Fault.NONE

    def _meet_anew(self, stamp: float) -> None:
        """Meet the accelerometer anew after a disagreement."""
        self._force.meet_anew()
        self._force.check.doubted_until = stamp + PredictedGravity.DRAW

    def _take_rate(self, sample: SensorSample) -> Fault:
        stamp, vector, _ = sample
        track, check = self._rate, self._force.check
        read = self.mounting.rate(np.array(vector))
        steady = check.is_steady and stamp - check.last_stamp < 2.0 * GravityCheck.GAP
        track.rest.add(stamp, read, check.mean if steady else None)
        rate = read - track.rest.bias
        self._agreement.rested = track.rest.is_known
        self._agreement.add_rate(stamp, rate @ self.mounting.rotation)
        fault = track.check.fault(rate, self._turning(stamp)[0] if self._rate_is_fresh(stamp) else None)
        wrong = self._agreement.found.fault
        if wrong is fault is Fault.NONE and track.rest.is_in_degrees:
            wrong = Fault.RATE_UNIT
        if wrong is not Fault.NONE:
            # it foretells nothing, and what it said is not used any more
            if self._predicted.disagrees:
                self._meet_anew(stamp)
            self._predicted.forget()
            track.filter.clear()
            return wrong
        if fault is Fault.RATE_TOO_FAST:
            self._predicted.forget()  # whatever it is, it does not say that the base stands still
        elif fault in (Fault.NONE, Fault.RATE_SPIKE):  # nor does a base say so that begins to turn at once
            self._predicted.turn(stamp, read)  # which has a bias of its own, and its mean must not leap
        if fault is not Fault.NONE or not track.check.believed:
            return fault
        if self._predicted.disagrees:
            return Fault.DISAGREEMENT
        dt, limit = stamp - track.filter.newest, self._ages.age_limit
        track.begin_anew_after(dt)
        track.watch_vertical(rate, min(dt, limit), check.reference, steady=steady)
        if dt <= limit and self._rate_is_known:
            self._attitude.turn(dt * rate)
        track.add(stamp, rate, dt)
        return Fault.NONE

    def _rate_is_fresh(self, time: float) -> bool:
        return time - self._rate.filter.newest <= self._ages.stale_after

    @property
    def _rate_is_known(self) -> bool:
        """Return whether rates are there, and were found to turn as gravity does, or by what leaves it where it is."""
        return (self._agreement.may_be_used or self._rate.is_unopposed) and self._rate.is_full

    def _status(self, time: float) -> ReadingStatus:
        newest, stops = self._force.filter.newest, self._fallback.stops
        fallen = ReadingStatus.STOP if stops else ReadingStatus.FALLBACK
        if newest == -math.inf:
            started = not stops or time - self._first_time <= self._ages.start_limit
            return ReadingStatus.NOMINAL if self._mode[0] is ReadingStatus.NOMINAL and started else fallen
        age = time - newest
        if age <= self._ages.stale_after and not self._predicted.disagrees:
            return ReadingStatus.LIVE
        return ReadingStatus.STALE if age <= self._ages.age_limit else fallen

    def _target(self, time: float, status: ReadingStatus, turning: bool) -> Floats:
        """Return where gravity, angular velocity and angular acceleration should be, (3, 3)."""
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            return self._motion(time, turning)
        gravity = LEVEL
        if status is not ReadingStatus.NOMINAL and self._fallback.gravity is not None:
            gravity = self._fallback.gravity(self)
        return np.array([gravity, np.zeros(3), np.zeros(3)])

    def newest_gravity(self) -> Floats:
        """Return gravity (3,) as of the newest sample: a parabola's guess of later is noisier; level before any."""
        newest = self._force.filter.newest
        if newest > -math.inf:
            self._held = self._motion(newest, self._rate_is_known and self._rate_is_fresh(newest))[0]
        return self._held

    def mean_gravity(self) -> Floats:
        """Return gravity (3,) along its mean direction of the last seconds."""
        return self._attitude.gravity()

    def _motion(self, time: float, turning: bool) -> Floats:
        """Return gravity at the base's origin, angular velocity and acceleration at a time [s], (3, 3)."""
        omega, alpha = self._turning(time) if turning else np.zeros((2, 3))
        return np.array([self._force.at(time) + self._lever(omega, alpha), omega, alpha])

    def _turning(self, time: float) -> Floats:
        """Return angular velocity and acceleration (2, 3) at a time [s], followed as far as gravity is."""
        rate = self._rate.filter
        return rate.at(min(time, rate.newest + self._force.horizon))

    def _doubt(self, time: float, turning: bool) -> float:
        """Return how far gravity may be off by a turn that is not, or not yet, accounted for [m/s2]."""
        sudden = self._force.sudden
        if not self._rate_is_fresh(time) or not self._rate.is_full:
            wrong = self._agreement.found.fault is not Fault.NONE
            return sudden + self._force.turning_doubt() + (self._agreement.lever() if wrong else 0.0)
        # rates that nothing checked yet, and are not used, may be right
        unused = 0.0 if turning else norm(self._lever(*self._turning(time)))
        return sudden + unused + norm(self.mounting.position) * self._rate.slope_error

    def _lever(self, omega: Floats, alpha: Floats) -> Floats:
        """Return what gravity at the origin has more than at the sensor (3,) [m/s2]."""
        p = self.mounting.position
        return cross(alpha, p) + cross(omega, cross(omega, p))

    def _faults(self, time: float, status: ReadingStatus) -> Fault:
        faults, limit = self._memory.faults(time), self._ages.stale_after
        if status is not ReadingStatus.LIVE:
            return faults | self._memory.silence(time, self._first_time, limit)
        return faults | Fault.RATES_INTERRUPTED if self._angular and not self._rate_is_fresh(time) else faults
