"""The gravity vector from an accelerometer, or from an accelerometer and a gyroscope, on the robot's base."""

import math
from collections.abc import Callable
from functools import reduce
from operator import or_

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.sensing.agreement import LEAN, AgreementWatch
from catenary.sensing.checks import (
    BaseSpectrum,
    Fault,
    GravityCheck,
    RateCheck,
    RawCheck,
    SensorRules,
    base_spectrum,
    norm,
    rules_for,
)
from catenary.sensing.delay_free_filter import DelayFreeFilter
from catenary.sensing.fallback import FALLBACKS, SlowAttitude, SmoothTransfer
from catenary.sensing.gyro_prediction import PredictedGravity, RestRate
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import GravityReading, Kind, Mailbox, ReadingStatus, SensorSample
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross

# how fast gravity, angular velocity and acceleration of the base may change as measured [m/s3, rad/s2, rad/s3]:
# ten times what rocking by 10 degrees at 1 Hz takes; and how fast they come back from a fault
FOLLOW = (100.0, 50.0, 400.0)
RECOVER = (10.0, 5.0, 40.0)
_TAKEN_AT_ONCE = 64  # samples in a tick: a queue that built up does not hold the tick up
_MEMORY = 0.1  # [s] for which a fault is reported after the sample that showed it
_PAUSE = 0.5  # [s] between reads, after which they begin anew
_FORGET = 1.0  # [s] without samples, after which a sensor is met anew
_EASED = 0.3  # [m/s2] by which a reading that is live may be off, by its way from a fallback and by turning
_CHECKED = 0.1  # [rad] of turning about the vertical, by rates that nothing else can check, while gravity stands still
_SLOW = 0.05  # [rad/s] that bias and noise may be of it
_BEGINS = 0.04  # [s] in which a base may have begun to turn as fast as gravity shows
_RECENT = 0.2  # [s] in which gravity's own change tells turning, where no gyroscope does
_DOUBTED = 0.1  # [s] over which a doubt goes
_SLOPE = 16.0  # by which a filter's slope is off where its value is behind, times the window
_SWINGS = 2.0  # [rad/s2] of angular acceleration that noise may be
_FOLLOWS = 0.02  # [s] over which noise averages out of what readings are ahead of the filter


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
        if not 0.0 < stale_after <= age_limit < math.inf:
            raise InputError(
                f"stale_after {stale_after}, age_limit {age_limit}: expected 0 < stale_after <= age_limit [s]"
            )
        spectrum = base_spectrum(mounted_on)
        attitude = spectrum.attitude_time if attitude_time is None else attitude_time
        cutoff = spectrum.cutoff_hz if cutoff_hz is None else cutoff_hz
        for name, value in (("attitude_time", attitude), ("start_limit", start_limit)):
            if not 0.0 < value < math.inf:
                raise InputError(f"{name}: expected more than 0 s, got {value}")
        self.mailbox, self.mounting = mailbox, Mounting() if mounting is None else mounting
        if fallback not in FALLBACKS:
            raise InputError(f'fallback "{fallback}": expected one of {", ".join(FALLBACKS)}')
        self.angular, self.fallback = angular, fallback
        self._rules = rules_for(mounted_on) if rules is None else rules
        self._stale_after, self._age_limit, self._start_limit = stale_after, age_limit, start_limit
        self._feed = feed
        m, r = self.mounting, self._rules
        self._raw = RawCheck(r, m.acceleration_range, (Fault.NOT_FINITE, Fault.STUCK, Fault.SATURATED))
        self._raw_rate = RawCheck(r, m.rate_range, (Fault.RATE_NOT_FINITE, Fault.RATE_STUCK, Fault.RATE_SATURATED))
        self._check, self._check_rate = GravityCheck(r), RateCheck(r)
        self._predicted, self._rest_rate = PredictedGravity(r), RestRate(r.still_rate)
        self._agreement = AgreementWatch(r, m.position @ m.rotation, checked=m.checked)
        self._force, self._rate = DelayFreeFilter(cutoff), DelayFreeFilter(cutoff)
        self._recent, self._changed = LEVEL, 0.0  # gravity of late, and how far it has moved from there [m/s2]
        self._sudden = self._doubted = 0.0  # [m/s2] that a lever may have made, of the newest reading and of late
        # of its filter: rates of late [rad/s], and so how far its slope, angular acceleration, may be off [rad/s2]
        self._rate_ahead, self._slope_error = np.zeros(3), 0.0
        self._attitude = SlowAttitude(attitude)
        self._transfer = SmoothTransfer(np.array(FOLLOW), np.array(RECOVER))
        self._about_vertical = 0.0  # [rad] turned of late
        self._seen: dict[Fault, float] = {}  # when each fault showed last
        self._heard = -math.inf  # when the newest sample was taken in, whatever it was worth
        self._held = LEVEL  # gravity that the fallback "hold" keeps
        self._last_time, self._first_time = math.nan, math.nan
        self._gaps = 0  # after which the parabola of gravity began anew
        self._mode: tuple[ReadingStatus, bool, int] = (ReadingStatus.NOMINAL, False, 0)
        self._said = ReadingStatus.NOMINAL
        self._ahead, self._ahead_limit = np.zeros(3), 0.8 * r.rest_spread  # of the filter: readings of late [m/s2]
        self._dropped = 0

    def read(self, time: float) -> GravityReading:
        """Return gravity and the turning of the base at a time [s], on the clock of the samples' stamps."""
        if not math.isfinite(time):
            time = 0.0 if math.isnan(self._last_time) else self._last_time
        if not time - self._last_time < _PAUSE:
            self._begin(time)
        else:
            if self._feed is not None:
                self._feed(time)
            self._take(time, _TAKEN_AT_ONCE)
        # angular terms are held with gravity, and given up at the age limit
        status, turning = self._status(time), self._rate_is_known and time - self._rate.newest <= self._age_limit
        changed = (status, turning, self._gaps) != self._mode
        self._mode = (status, turning, self._gaps)
        dt = min(max(time - self._last_time, 0.0), 0.02)
        self._last_time = time
        gravity, *rates = self._transfer.follow(self._target(time, status, turning), dt, changed=changed)
        self._doubted = max(self._doubt(time, turning), self._doubted * math.exp(-dt / _DOUBTED))
        is_behind = self._transfer.behind + self._doubted > _EASED or norm(self._ahead) > self._ahead_limit
        is_behind |= self._check.last_stamp > self._force.newest  # the last reading was not believed
        if status is not ReadingStatus.LIVE or not is_behind:
            self._said = status
        elif self._said is ReadingStatus.LIVE:
            self._said = ReadingStatus.STALE
        said = self._said
        nominal = said is ReadingStatus.NOMINAL or (said is ReadingStatus.FALLBACK and self.fallback == "static")
        age = math.inf if nominal or self._force.newest == -math.inf else max(0.0, time - self._force.newest)
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
        self._dropped = self.mailbox.dropped
        self._seen.clear()
        self._transfer.restart()

    def _take(self, now: float, most: int) -> None:
        if self.mailbox.dropped != self._dropped:
            self._dropped = self.mailbox.dropped
            self._seen[Fault.SAMPLES_LOST] = now
        for _ in range(most):
            sample = self.mailbox.take()
            if sample is None:
                return
            self._heard = now
            turns = sample.kind is Kind.ANGULAR_RATE
            if turns and not self.angular:
                continue
            fault = (self._raw_rate if turns else self._raw).fault(sample.stamp, sample.vector, now)
            if fault is Fault.NONE and now - sample.stamp > self._age_limit:
                fault = Fault.STAMP_OLD
            if fault is Fault.NONE:
                fault = self._take_rate(sample) if turns else self._take_force(sample)
            if fault is not Fault.NONE:
                self._seen[fault] = now

    def _take_force(self, sample: SensorSample) -> Fault:
        stamp, vector, kind = sample
        gravity = self.mounting.gravity(np.array(vector), kind)
        in_sensor = gravity @ self.mounting.rotation
        if self._predicted.disagrees:
            self._agreement.add_gravity(stamp, in_sensor)  # which of them is wrong may be found meanwhile
            if self._predicted.compare(stamp, gravity):
                return Fault.DISAGREEMENT
            self._meet_anew(stamp)
        # after a second without any sample; wrong ones keep their reason to be doubted
        if self._force.newest > -math.inf and stamp - self._check.last_stamp > _FORGET:
            self._check.forget()
            self._force.clear()
        rate = self._rate.at(stamp)[0] if self._rate_is_fresh(stamp) else None
        expected = self._force.at(min(stamp, self._force.newest + self._horizon))[0]
        sudden = norm(gravity - expected) - self._rules.rest_spread
        self._sudden = max(0.0, min(sudden, norm(self.mounting.position) * GravityCheck.JERKY))
        swing = 0.0 if rate is None else norm(self._rate.at(stamp)[1]) + self._slope_error - _SWINGS
        fault = self._check.fault(stamp, gravity, expected, rate, max(0.0, swing))
        if fault is Fault.NONE and self._check.reference is not None:
            self._agreement.add_gravity(stamp, in_sensor)
            known = rate is not None and self._rate_is_known
            if self._predicted.compare(stamp, gravity + self._lever(*self._turning(stamp)) if known else gravity):
                return Fault.DISAGREEMENT
            dt = stamp - self._force.newest
            if dt > 0.5 * self._force.window:
                self._force.clear()  # a parabola over a gap would be a guess
                self._gaps += 1
            self._force.add(stamp, gravity)
            ahead = gravity - self._force.at(stamp)[0]
            self._ahead = self._ahead + (1.0 - math.exp(-dt / _FOLLOWS)) * (ahead - self._ahead)
            if norm(self._ahead) > self._ahead_limit:
                self._seen[Fault.NOT_FOLLOWED] = stamp
            self._attitude.add(stamp, gravity)
            moved = self._force.at(stamp)[0] - self._recent
            self._recent = self._recent + (1.0 - math.exp(-dt / _RECENT)) * moved
            # a lever and a turn may undo each other for a moment
            self._changed = max(norm(moved), self._changed * math.exp(-dt / (2.0 * _RECENT))) if dt < _PAUSE else 0.0
        return fault

    def _meet_anew(self, stamp: float) -> None:
        """Meet the accelerometer anew after a disagreement."""
        self._check.forget()
        self._check.doubted_until = stamp + PredictedGravity.DRAW
        self._force.clear()

    def _take_rate(self, sample: SensorSample) -> Fault:
        stamp, vector, _ = sample
        read = self.mounting.rate(np.array(vector))
        steady = self._check.is_steady and stamp - self._check.last_stamp < 2.0 * GravityCheck.GAP
        self._rest_rate.add(stamp, read, self._check.mean if steady else None)
        rate = read - self._rest_rate.bias
        self._agreement.rested = self._rest_rate.is_known
        self._agreement.add_rate(stamp, rate @ self.mounting.rotation)
        expected = self._rate.at(min(stamp, self._rate.newest + self._horizon))[0]
        fault = self._check_rate.fault(rate, expected if self._rate_is_fresh(stamp) else None)
        wrong = self._agreement.found.fault
        if wrong is fault is Fault.NONE and self._rest_rate.is_in_degrees:
            wrong = Fault.RATE_UNIT
        if wrong is not Fault.NONE:
            # it foretells nothing, and what it said is not used any more
            if self._predicted.disagrees:
                self._meet_anew(stamp)
            self._predicted.forget()
            self._rate.clear()
            return wrong
        if fault is Fault.RATE_TOO_FAST:
            self._predicted.forget()  # whatever it is, it does not say that the base stands still
        elif fault in (Fault.NONE, Fault.RATE_SPIKE):  # nor does a base say so that begins to turn at once
            self._predicted.turn(stamp, read)  # which has a bias of its own, and its mean must not leap
        if fault is not Fault.NONE or not self._check_rate.believed:
            return fault
        if self._predicted.disagrees:
            return Fault.DISAGREEMENT
        dt = stamp - self._rate.newest
        if dt > 0.5 * self._rate.window:
            self._rate.clear()
        down, fast = self._check.reference, norm(rate)
        upright = down is not None and norm(cross(down, rate)) < LEAN * fast * norm(down)
        if not steady or (not upright and fast > _SLOW):
            self._about_vertical = 0.0
        elif upright:
            self._about_vertical += min(dt, self._age_limit) * fast
        if dt <= self._age_limit and self._rate_is_known:
            self._attitude.turn(dt * rate)
        self._rate.add(stamp, rate)
        share = 1.0 - math.exp(-10.0 * dt / self._rate.window)
        self._rate_ahead = self._rate_ahead + share * (rate - self._rate.at(stamp)[0] - self._rate_ahead)
        self._slope_error = _SLOPE * norm(self._rate_ahead) / self._rate.window
        return Fault.NONE

    @property
    def _horizon(self) -> float:
        """Time beyond the newest sample for which a parabola is followed [s]; further it would run away."""
        return 0.6 * self._force.window

    def _rate_is_fresh(self, time: float) -> bool:
        return time - self._rate.newest <= self._stale_after

    @property
    def _rate_is_known(self) -> bool:
        """Return whether rates are there, and were found to turn as gravity does, or by what leaves it where it is."""
        checked = self._agreement.may_be_used or self._about_vertical > _CHECKED
        return checked and self._rate.span >= 0.6 * self._rate.window

    def _status(self, time: float) -> ReadingStatus:
        if self._force.newest == -math.inf:
            started = self.fallback != "stop" or time - self._first_time <= self._start_limit
            waiting = self._mode[0] is ReadingStatus.NOMINAL and started
            return ReadingStatus.NOMINAL if waiting else self._fallen()
        age = time - self._force.newest
        if age <= self._stale_after and not self._predicted.disagrees:
            return ReadingStatus.LIVE
        return ReadingStatus.STALE if age <= self._age_limit else self._fallen()

    def _fallen(self) -> ReadingStatus:
        return ReadingStatus.STOP if self.fallback == "stop" else ReadingStatus.FALLBACK

    def _target(self, time: float, status: ReadingStatus, turning: bool) -> Floats:
        """Return where gravity, angular velocity and angular acceleration should be, (3, 3)."""
        if status in (ReadingStatus.LIVE, ReadingStatus.STALE):
            return self._motion(time, turning)
        newest = self._force.newest
        if status is ReadingStatus.NOMINAL or self.fallback == "static":
            gravity = LEVEL
        elif self.fallback == "fade":
            gravity = self._attitude.gravity()
        else:
            if newest > -math.inf:
                # as of the newest sample: what a parabola says of later is a guess, and noisier
                self._held = self._motion(newest, self._rate_is_known and self._rate_is_fresh(newest))[0]
            gravity = self._held
        return np.array([gravity, np.zeros(3), np.zeros(3)])

    def _motion(self, time: float, turning: bool) -> Floats:
        """Return gravity at the base's origin, angular velocity and acceleration at a time [s], (3, 3)."""
        omega, alpha = self._turning(time) if turning else np.zeros((2, 3))
        gravity = self._force.at(min(time, self._force.newest + self._horizon))[0]
        return np.array([gravity + self._lever(omega, alpha), omega, alpha])

    def _turning(self, time: float) -> Floats:
        return self._rate.at(min(time, self._rate.newest + self._horizon))

    def _doubt(self, time: float, turning: bool) -> float:
        """Return how far gravity may be off by a turn that is not, or not yet, accounted for [m/s2]."""
        if not self._rate_is_fresh(time) or self._rate.span < 0.6 * self._rate.window:
            # what moved it may be the lever alone, as of a turn about the vertical, or a turn with what it does to that
            own = self._changed / (STANDARD_GRAVITY * _RECENT)
            return self._sudden + min(1.25 * self._changed, norm(self.mounting.position) * (own * own + own / _BEGINS))
        # rates that nothing checked yet, and are not used, may be right
        unused = 0.0 if turning else norm(self._lever(*self._turning(time)))
        return self._sudden + unused + norm(self.mounting.position) * self._slope_error

    def _lever(self, omega: Floats, alpha: Floats) -> Floats:
        """Return what gravity at the origin has more than at the sensor (3,) [m/s2]."""
        p = self.mounting.position
        return cross(alpha, p) + cross(omega, cross(omega, p))

    def _faults(self, time: float, status: ReadingStatus) -> Fault:
        faults = reduce(or_, (fault for fault, seen in self._seen.items() if time - seen <= _MEMORY), Fault.NONE)
        silent = time - self._heard > self._stale_after
        if status is not ReadingStatus.LIVE and silent and time - self._first_time > self._stale_after:
            faults |= Fault.NOTHING_RECEIVED if self._heard == -math.inf else Fault.INTERRUPTED
        if status is ReadingStatus.LIVE and self.angular and not self._rate_is_fresh(time):
            faults |= Fault.RATES_INTERRUPTED
        return faults
