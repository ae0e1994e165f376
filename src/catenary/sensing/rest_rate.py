"""What a gyroscope reads while its base stands still: its bias."""

import math

import numpy as np

from catenary.arrays import Floats


class RestRate:
    """The bias of a gyroscope, drawn to its mean whenever the base has stood still for a while.

    At rest are an accelerometer that is steady and rates that are slow and vary no more than noise. Slow even turning
    about the vertical looks the same, and is taken for bias: its accelerations are too small to matter.
    """

    REST = 2.0  # [s] for which the base must have stood still
    MEMORY = 1.0  # [s] over which mean and spread are taken
    SPREAD = 0.01  # [rad/s] standard deviation of the three axes together: five times a cheap sensor's
    DRAW = 5.0  # [s] over which the bias is drawn to the mean

    def __init__(self, largest: float) -> None:
        """Take the largest rate that may be bias [rad/s]."""
        self._largest = largest
        self.bias = np.zeros(3)
        self._mean, self._variance = np.zeros(3), 0.0
        self._last, self._since = -math.inf, math.inf

    def add(self, stamp: float, rate: Floats, *, steady: bool) -> None:
        """Take a rate (3,) [rad/s], and whether the accelerometer is steady."""
        dt, self._last = stamp - self._last, stamp
        if not 0.0 < dt < self.MEMORY:
            self._mean, self._variance, self._since = rate, 0.0, math.inf
            return
        share = 1.0 - math.exp(-dt / self.MEMORY)
        off = rate - self._mean
        self._mean = self._mean + share * off
        self._variance = (1.0 - share) * (self._variance + share * float(off @ off))
        length = math.sqrt(float(self._mean @ self._mean))
        if not (steady and self._variance <= self.SPREAD**2 and length <= self._largest):
            self._since = math.inf
        elif self._since == math.inf:
            self._since = stamp
        if stamp - self._since >= self.REST:
            self.bias = self.bias + (1.0 - math.exp(-dt / self.DRAW)) * (self._mean - self.bias)
