"""Gravity as a gyroscope predicts it, to compare with what an accelerometer says; and a gyroscope's bias, at rest."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.checks import GravityCheck, norm
from catenary.spatial import STANDARD_GRAVITY, cross


class RestRate:
    """The bias of a gyroscope: its mean when the base first stood still for a while, drawn to it in later rests.

    At rest are an accelerometer that stays where it is and rates that are slow and vary no more than noise. Slow even
    turning about the vertical looks the same, and is taken for bias: its accelerations are too small to matter.
    """

    REST = 2.0  # [s] for which the base must have stood still
    MEMORY = 1.0  # [s] over which mean and spread are taken
    MOVED = 0.15  # [m/s2] by which gravity moves meanwhile at most: a turn by a degree
    SPREAD = 0.01  # [rad/s] standard deviation of the three axes together: five times a cheap sensor's
    DRAW = 5.0  # [s] over which the bias is drawn to the mean
    # [rad/s] of noise alone, three axes together: no gyroscope has so much; a cheap one has 0.0015, or 0.09 deg/s
    ABSURD = 0.03

    def __init__(self, largest: float) -> None:
        """Take the largest rate that may be bias [rad/s]."""
        self._largest = largest
        self.bias = np.zeros(3)
        self.is_known = False
        self._mean, self._variance = np.zeros(3), 0.0
        self._last, self._since, self._gravity = -math.inf, math.inf, np.zeros(3)
        self._before, self._noise, self._noisy_since = np.zeros((2, 3)), 0.0, math.inf

    @property
    def is_in_degrees(self) -> bool:
        """Its noise at rest is that of numbers in deg/s."""
        return self._last - self._noisy_since >= 0.5 * self.REST

    def add(self, stamp: float, rate: Floats, gravity: Floats | None) -> None:
        """Take a rate (3,) [rad/s], and what the accelerometer reads (3,) while it is steady [m/s2]."""
        dt, self._last = stamp - self._last, stamp
        if not 0.0 < dt < self.MEMORY:
            self._mean, self._variance, self._since = rate, 0.0, math.inf
            self._before, self._noise, self._noisy_since = np.array([rate, rate]), 0.0, math.inf
            return
        share = 1.0 - math.exp(-dt / self.MEMORY)
        # what neither a rate nor its change explains
        rough = rate - 2.0 * self._before[1] + self._before[0]
        self._before = np.array([self._before[1], rate])
        self._noise += share * (min(float(rough @ rough) / 6.0, 4.0 * self.ABSURD**2) - self._noise)
        is_noisy = gravity is not None and self._noise > self.ABSURD**2
        self._noisy_since = min(self._noisy_since, stamp) if is_noisy else math.inf
        off = rate - self._mean
        self._mean = self._mean + share * off
        self._variance = (1.0 - share) * (self._variance + share * float(off @ off))
        length = math.sqrt(float(self._mean @ self._mean))
        if gravity is None or self._variance > self.SPREAD**2 or length > self._largest:
            self._since = math.inf
        elif self._since == math.inf or norm(gravity - self._gravity) > self.MOVED:
            self._since, self._gravity = stamp, gravity
        if stamp - self._since >= self.REST:
            share = 1.0 - math.exp(-dt / self.DRAW) if self.is_known else 1.0
            self.bias, self.is_known = self.bias + share * (self._mean - self.bias), True


class PredictedGravity:
    """Gravity as the gyroscope predicts it, to find a base that tips while its gyroscope says that it stands still.

    Gravity as last sensed is turned along by the angular rates and drawn slowly towards what is sensed. A base that
    stands still by its gyroscope may differ from it by a push, by accelerations that show in gravity's length (a push
    across gravity lengthens it, a tip does not), and by what adds up to no more speed than a push gives. Which of both
    sensors is wrong cannot be told: where they move together again, they stay apart by what came between, until the
    accelerometer is back, or the gyroscope was found wrong.
    """

    START = 1.0  # [s] over which the first readings are averaged before any is judged
    AWHILE = 5.0  # [s] in its place where the base moved meanwhile
    MOVED = 0.15  # [m/s2] by which it shows that it did
    DRAW = 10.0  # [s] over which gravity is drawn to what is sensed, and its length
    DRAW_RESTED = 30.0  # [s] the same with a gyroscope whose bias is known
    SHORTENING = 1.0  # [s] over which the length follows shorter readings: pushes lengthen them
    SMOOTH = 0.05  # [s] over which vibrations average out
    STILL_RATE = 0.15  # [rad/s] below which a gyroscope says that the base stands still; more than its bias
    AFTER_TURNING = 0.5  # [s] for which accelerations of a turn may go on
    AGREES_S = 0.5  # [s] for which sensors that disagreed must agree
    SURE = 0.03  # [m/s2] to which it is known
    PUSH_S = 0.5  # [s] that the hardest push lasts
    SPEED_S = 10.0  # [s] over which speed is forgotten

    def __init__(self, push: float) -> None:
        """Take the hardest push [m/s2]."""
        self._push = push
        self.forget()

    def forget(self) -> None:
        """Forget all readings."""
        self._gravity: Floats | None = None
        self._before: Floats | None = None  # what it would be now, had they not come apart
        self.apart = 0.0  # [m/s2] by how much they still are
        self._off, self._bias, self._rate, self._speed = np.zeros((4, 3))  # of readings from it, smoothed; of rates
        self._length, self._began, self._judged_from = 0.0, math.inf, math.inf
        self._lively = 0.0  # [m2/s4] variance of the length: what pushes upwards does so across gravity too
        self._stamp = self._rate_stamp = -math.inf
        self._turning = 0.0  # [rad/s] the largest rate of late
        self._disagree_since, self._apart_since, self._draw = math.inf, math.inf, self.DRAW
        self._is_resting, self.disagrees = True, False

    def turn(self, stamp: float, rate: Floats, rested: Floats | None, fitted: Floats | None) -> None:
        """Take a rate (3,) [rad/s] that is believed as far as it goes, and its bias as seen at rest, or in turns."""
        dt, self._rate_stamp = stamp - self._rate_stamp, stamp
        if not 0.0 < dt < GravityCheck.REST:
            self._gravity = None
            return
        if rested is not None:
            self._bias, self._draw = rested, self.DRAW_RESTED
        elif fitted is not None and not self._is_resting:
            self._bias = fitted
        self._turning = max(norm(rate - self._bias), self._turning * math.exp(-dt / self.AFTER_TURNING))
        self._rate = rate
        angle = dt * (rate - self._bias)
        if self._gravity is not None:
            self._gravity = _turned(self._gravity, angle)
        if self._before is not None:
            self._before = _turned(self._before, angle)

    def compare(self, stamp: float, gravity: Floats, deviation: float) -> bool:
        """Take gravity (3,) [m/s2] as filtered, and its deviation; return whether the sensors come apart."""
        dt, self._stamp = min(stamp - self._stamp, GravityCheck.REST), stamp
        if self._gravity is None:
            # without rates nothing is predicted
            self._gravity = gravity if stamp - self._rate_stamp < GravityCheck.GAP else None
            self._off, self._speed, self._length, self._began = np.zeros(3), np.zeros(3), norm(gravity), stamp
            self._judged_from, self._is_resting = stamp + self.START, True
            self.disagrees = False
            return False
        off = gravity - self._gravity
        age = stamp - self._began
        if age <= self.START and norm(self._off) > self.MOVED:
            self._judged_from, self._is_resting = self._began + self.AWHILE, False
        if age <= self.START and self._is_resting and self._draw == self.DRAW:
            self._bias = self._bias + min(1.0, dt / age) * (self._rate - self._bias)
        self._off = self._off + (1.0 - math.exp(-dt / self.SMOOTH)) * (off - self._off)
        now, size = self._gravity + self._off, norm(self._off)
        longer = norm(now) - self._length
        self._length += self._share(stamp, dt, self.DRAW if longer > 0.0 else self.SHORTENING) * longer
        self._lively += min(1.0, dt / self.DRAW) * ((norm(gravity) - STANDARD_GRAVITY) ** 2 - self._lively)
        leant = self._leant(now)
        known = leant + self._leant(self._gravity) + 3.0 * deviation
        apart = size - known
        # a push that its length shows does not draw
        drawn = max(0.0, 1.0 - leant / max(size, 1e-9)) if stamp > self._judged_from else 1.0
        self._gravity = self._gravity + drawn * self._share(stamp, dt, self._draw) * off
        judged = self._turning < self.STILL_RATE and stamp > self._judged_from
        self._speed *= math.exp(-dt / self.SPEED_S)
        if judged and apart > 0.0 and (self._is_resting or self._draw == self.DRAW_RESTED):  # its bias is known
            self._speed += dt * apart / size * self._off
        # once they disagreed, they are held to half as much
        limit = (0.5 * self._push if self.disagrees else self._push) + 3.0 * math.sqrt(self._lively)
        if self._before is not None and norm(now - self._before) < 0.5 * self._push + known < apart + known:
            self._gravity, self._off, self._speed = now, np.zeros(3), np.zeros(3)  # it is back
        elif judged and (apart > limit or norm(self._speed) > limit * self.PUSH_S):
            self._before = self._gravity if self._before is None else self._before
            self.disagrees, self._disagree_since = True, stamp
            self._gravity, self._off, self._speed = now, np.zeros(3), np.zeros(3)
        elif stamp - self._disagree_since >= self.AGREES_S:
            self.disagrees = False
        if self._before is not None:
            self._watch_return(stamp, norm(now - self._before), known)
        return self.disagrees

    def _watch_return(self, stamp: float, apart: float, known: float) -> None:
        """Take by how much the sensors are apart since they disagreed [m/s2]."""
        self.apart = apart
        if apart > 0.5 * self._push + known:
            self._apart_since = stamp
        elif stamp - self._apart_since >= self.AGREES_S:
            self._before, self.apart = None, 0.0

    def _share(self, stamp: float, dt: float, memory: float) -> float:
        """Return the weight of a sample in a mean over `memory` [s], at first in one over all there were."""
        age = stamp - self._began
        return min(1.0, dt / (memory if stamp > self._judged_from else max(age, dt)))

    def _leant(self, gravity: Floats) -> float:
        """Return the acceleration across gravity that makes a reading as long as it is [m/s2]."""
        rest = self._length + self.SURE
        return math.sqrt(max(0.0, float(gravity @ gravity) - rest * rest))


def _turned(gravity: Floats, angle: Floats) -> Floats:
    """Return gravity (3,) as seen from axes that have turned by a small angle (3,) [rad]."""
    turned = gravity - cross(angle, gravity)
    return np.asarray(turned * (norm(gravity) / norm(turned)))
