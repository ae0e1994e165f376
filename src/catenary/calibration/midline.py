"""The midline of a torque or current: its mean over both directions of travel, which is the load without the friction.

A cable stretches by the load that it carries, and much of the friction acts before it stretches. So a torque as it is
read serves neither: it jumps at every reversal, where the joint does not. A stop operator tells when a motion has left
its last reversal behind [Brokate and Sprekels 1996]; from then on the torque counts towards the mean of its direction,
which forgets over travel, not time.
"""

from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Floats, Integers
from catenary.calibration.arithmetic import exp_minus_1
from catenary.calibration.spike_filter import AWAY
from catenary.kernels.compiled import compiled

# of the joint's range in training [3 and 40 deg of a da Vinci tool's 60]
RADIUS_SHARE, TRAVEL_SHARE = 0.05, 0.67
_FULL_SHARE = 0.9999  # share of the radius at which the stop has been reached
STATE_COUNT = 4  # numbers that a midline remembers
Midline = tuple[
    str,  # signal
    str,  # position whose travel counts
    Annotated[float, Field(gt=0.0)],  # half of the travel after a reversal that does not count [rad|m]
    Annotated[float, Field(gt=0.0)],  # over which it forgets [rad|m]
]


@compiled
def follow_midlines(
    signals: Floats,  # (N, S) what the robot reports, row after row
    sources: Integers,  # (M,) which signals have midlines
    places: Integers,  # (M,) which signals are the positions that they follow
    owners: Integers,  # (M,) which columns of `course` these have
    course: Integers,  # (N, J) see `find_leaps`
    radii: Floats,  # (M,)
    travels: Floats,  # (M,)
    at: Integers,  # (1,) first column to write
    midline: Floats,  # (M, STATE_COUNT) position before, stop, means forwards and backwards; NaN before the first row
    X: Floats,  # (N, F) receives the midlines
) -> None:
    """Write midlines of rows of one motion, NaN until both directions were seen; NaN and leaps change nothing."""
    for row in range(len(signals)):
        for i in range(len(sources)):
            x, s = signals[row, places[i]], signals[row, sources[i]]
            if np.isfinite(x) and np.isfinite(s) and course[row, owners[i]] != AWAY:
                first = np.isnan(midline[i, 0])
                moved = 0.0 if first else x - midline[i, 0]
                stop = 0.0 if first else midline[i, 1]
                stop = min(max(stop + moved, -radii[i]), radii[i])
                midline[i, 0], midline[i, 1] = x, stop
                side = 2 if stop >= _FULL_SHARE * radii[i] else (3 if stop <= -_FULL_SHARE * radii[i] else 0)
                if side > 0:
                    mean = midline[i, side]
                    share = -exp_minus_1(-min(abs(moved) / travels[i], 40.0))
                    midline[i, side] = s if np.isnan(mean) else mean + share * (s - mean)
            X[row, at[0] + i] = 0.5 * (midline[i, 2] + midline[i, 3])
