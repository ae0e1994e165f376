"""Gyroscope bias at rest, and gravity predicted by a gyroscope to detect disagreement with an accelerometer."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.sensing.imu_faults import GravityCheck, norm
from catenary.spatial import STANDARD_GRAVITY, cross


class RestRate:
    """Estimate a gyroscope's bias: its mean in the first rest, low-pass filtered over later rests.

    At rest gravity is constant, and rates are small and vary by noise only. Slow constant rotation about the vertical
    looks the same and is taken for bias: its accelerations are negligible.
    """

    REST = 2.0  # [s] least duration of a rest
    MEMORY = 1.0  # [s] averaging time of mean and spread
    MOVED = 0.15  # [m/s2] largest change of gravity in a rest: a turn by a degree
    SPREAD = 0.01  # [rad/s] standard deviation of the three axes together: five times a cheap sensor's
    DRAW = 5.0  # [s] time constant of the bias
    # [rad/s] of noise, three axes together: more than any gyroscope has; a cheap one has 0.0015, or 0.09 deg/s
    MAX_NOISE = 0.03

    def __init__(self, largest: float) -> None:
        """Set the largest rate that is taken for bias [rad/s]."""
        self._largest = largest
        self.bias = np.zeros(3)
        self.is_known = False
        self._mean, self._variance = np.zeros(3), 0.0
        self._last, self._since, self._gravity = -math.inf, math.inf, np.zeros(3)
        self._before, self._noise, self._noisy_since = np.zeros((2, 3)), 0.0, math.inf

    @property
    def is_in_degrees(self) -> bool:
        """The noise at rest is that of values in deg/s."""
        return self._last - self._noisy_since >= 0.5 * self.REST

    def add(self, stamp: float, rate: Floats, gravity: Floats | None) -> None:
        """Add a rate (3,) [rad/s], and the steady accelerometer reading (3,) [m/s2], None if it is not steady."""
        dt, self._last = stamp - self._last, stamp
        if not 0.0 < dt < self.MEMORY:
            self._mean, self._variance, self._since = rate, 0.0, math.inf
            self._before, self._noise, self._noisy_since = np.array([rate, rate]), 0.0, math.inf
            return
        share = 1.0 - math.exp(-dt / self.MEMORY)
        # second difference: neither rate nor its slope contributes
        rough = rate - 2.0 * self._before[1] + self._before[0]
        self._before = np.array([self._before[1], rate])
        self._noise += share * (min(float(rough @ rough) / 6.0, 4.0 * self.MAX_NOISE**2) - self._noise)
        is_noisy = gravity is not None and self._noise > self.MAX_NOISE**2
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
    """Predict gravity from angular rates, to detect a base that tips while its gyroscope reads zero.

    The prediction is rotated by the gyroscope and low-pass filtered towards sensed gravity. While the gyroscope reads
    zero, sensed gravity may differ from it by a push, by accelerations that show in gravity's length (a push across
    gravity lengthens it, a tip does not), and by whatever integrates to less speed than a push gives. Which of the two
    sensors is wrong cannot be decided: they stay in disagreement by the difference until the accelerometer
    returns, or the gyroscope is found wrong.
    """

    START = 1.0  # [s] initial average, before any reading is compared
    START_MOVED = 5.0  # [s] the same if the base moved meanwhile
    MOVED = 0.15  # [m/s2] change of gravity that shows motion
    DRAW = 10.0  # [s] time constant of predicted gravity and of its length
    DRAW_RESTED = 30.0  # [s] the same with a gyroscope whose bias is known
    SHORTENING = 1.0  # [s] time constant of the length towards shorter readings: pushes lengthen them
    SMOOTH = 0.05  # [s] time constant that averages vibration out
    STILL_RATE = 0.15  # [rad/s] largest rate of a base at rest, above any bias
    AFTER_TURNING = 0.5  # [s] for which accelerations of a turn may last
    AGREES_S = 0.5  # [s] of agreement that end a disagreement
    LENGTH_ERROR = 0.03  # [m/s2] of the length
    PUSH_S = 0.5  # [s] duration of the hardest push
    SPEED_S = 10.0  # [s] time constant of the integrated speed

    def __init__(self, push: float) -> None:
        """Set the hardest push [m/s2]."""
        self._push = push
        self.forget()

    def forget(self) -> None:
        """Forget all readings."""
        self._gravity: Floats | None = None
        self._before: Floats | None = None  # prediction from before the disagreement
        self.apart = 0.0  # [m/s2] remaining difference
        self._off, self._bias, self._rate, self._speed = np.zeros((4, 3))  # of readings from it, smoothed; of rates
        self._length, self._began, self._judged_from = 0.0, math.inf, math.inf
        self._deviation = 0.0  # [m/s2] of predicted gravity
        self._lively = 0.0  # [m2/s4] variance of the length: upward accelerations come with horizontal ones
        self._stamp = self._rate_stamp = -math.inf
        self._turning = 0.0  # [rad/s] largest recent rate
        self._disagree_since, self._apart_since, self._draw = math.inf, math.inf, self.DRAW
        self._is_resting, self.disagrees = True, False

    def turn(self, stamp: float, rate: Floats, rested: Floats | None, fitted: Floats | None) -> None:
        """Rotate the prediction by a rate (3,) [rad/s], less its bias (3,) from rests, or else as fitted in turns."""
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
        """Return true if filtered gravity (3,) [m/s2] with its standard deviation disagrees with the prediction."""
        dt, self._stamp = min(stamp - self._stamp, GravityCheck.REST), stamp
        if self._gravity is None:
            # without rates nothing is predicted
            self._gravity = gravity if stamp - self._rate_stamp < GravityCheck.GAP else None
            self._off, self._speed, self._length, self._began = np.zeros(3), np.zeros(3), norm(gravity), stamp
            self._judged_from, self._is_resting = stamp + self.START, True
            self.disagrees, self._deviation = False, deviation
            return False
        off = gravity - self._gravity
        age = stamp - self._began
        if age <= self.START and norm(self._off) > self.MOVED:
            self._judged_from, self._is_resting = self._began + self.START_MOVED, False
        if age <= self.START and self._is_resting and self._draw == self.DRAW:
            self._bias = self._bias + min(1.0, dt / age) * (self._rate - self._bias)
        self._off = self._off + (1.0 - math.exp(-dt / self.SMOOTH)) * (off - self._off)
        now, size = self._gravity + self._off, norm(self._off)
        longer = norm(now) - self._length
        self._length += self._share(stamp, dt, self.DRAW if longer > 0.0 else self.SHORTENING) * longer
        self._lively += min(1.0, dt / self.DRAW) * ((norm(gravity) - STANDARD_GRAVITY) ** 2 - self._lively)
        leant = self._leant(now)
        known = leant + self._leant(self._gravity) + 3.0 * (deviation + self._deviation)
        apart = size - known
        # a push that shows in the length does not change the prediction
        drawn = max(0.0, 1.0 - leant / max(size, 1e-9)) if stamp > self._judged_from else 1.0
        share = drawn * self._share(stamp, dt, self._draw)
        self._gravity = self._gravity + share * off
        self._deviation += share * (deviation - self._deviation)  # as if their errors were one
        judged = self._turning < self.STILL_RATE and stamp > self._judged_from
        self._speed *= math.exp(-dt / self.SPEED_S)
        if judged and apart > 0.0 and (self._is_resting or self._draw == self.DRAW_RESTED):  # its bias is known
            self._speed += dt * apart / size * self._off
        # after a disagreement the limit is halved
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
        else:  # it is no push by the odds of so much speed
            self.apart = max(0.0, apart) * (norm(self._speed) / (limit * self.PUSH_S)) ** 2 if judged else 0.0
        return self.disagrees

    def _watch_return(self, stamp: float, apart: float, known: float) -> None:
        """Update the difference of the sensors after a disagreement [m/s2], and end it once they agree."""
        self.apart = apart
        if apart > 0.5 * self._push + known:
            self._apart_since = stamp
        elif stamp - self._apart_since >= self.AGREES_S:
            self._before, self.apart = None, 0.0

    def _share(self, stamp: float, dt: float, memory: float) -> float:
        """Return the weight of a sample in a mean over `memory` [s], at first over all samples so far."""
        age = stamp - self._began
        return min(1.0, dt / (memory if stamp > self._judged_from else max(age, dt)))

    def _leant(self, gravity: Floats) -> float:
        """Return the acceleration across gravity that explains a reading's length [m/s2]."""
        length = self._length + self.LENGTH_ERROR
        return math.sqrt(max(0.0, float(gravity @ gravity) - length * length))


def _turned(gravity: Floats, angle: Floats) -> Floats:
    """Return gravity (3,) in axes that have turned by a small angle (3,) [rad], its length kept."""
    turned = gravity - cross(angle, gravity)
    return np.asarray(turned * (norm(gravity) / norm(turned)))
