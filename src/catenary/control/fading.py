"""Leaps of a correction that come on slowly, so that an arm at rest does not jump by its own calibration."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats

FADE = 1.5  # [s] from a leap until all of it has come on


class Fade:
    """What is left out of a correction that leaps: all of the leap at first, then in equal steps ever less."""

    def __init__(self, correction: Floats, period: float) -> None:
        """Begin at a correction (n,) [rad|m] that is already acting, in ticks of `period` [s]."""
        self._last, self._share = correction, period / FADE
        self._left = self._step = np.zeros(len(correction))

    def left_out(self, correction: Floats, leaps: ArrayLike) -> Floats:
        """Return what is left out of a tick's correction (n,) [rad|m], which `leaps` from the last one where told."""
        leap = np.where(leaps, np.nan_to_num(correction - self._last), 0.0)
        self._last = correction
        if leap.any():
            self._left = self._left + leap
            self._step = self._share * np.abs(self._left)
        left = self._left
        self._left = left - np.clip(left, -self._step, self._step)
        return left
