"""Positions that leap and return: spikes of a sensor, which leave the memory of a calibration model alone."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.kernels.compiled import compiled
from catenary.plant import MotionLog

_STEP_MARGIN = 4.0  # times the fastest step of the training rows: other motions may be faster
ANY_SIZE = 1e300  # any step, correction or position: finite, as C writes it too
_CONFIRM_ROWS = 3  # rows in a row that have not returned are the truth: the joint is there
# Steps beyond this share of a limit are of another motion, twice as fast as any row of training. Where they are
# several per cent of the rows (_SEVERAL_ROWS of them, each counting less by _FADE_FACTOR a row later), nothing is
# a spike.
_FAST_SHARE, _FADE_FACTOR, _SEVERAL_ROWS = 0.5, 0.98, 1.5


def room_of(log: MotionLog, period: float | None) -> Floats:
    """Return the number (N,) of periods [s] that each row had to move since the one before, 1 or more; 1 for None."""
    room = np.ones(len(log))
    if period is not None and log.time is not None:
        room[1:] = np.maximum(1.0, np.diff(log.time) / period)
    return room


def largest_step(motions: Sequence[tuple[Floats, Floats]]) -> float:
    """Return the largest credible step of a joint between rows: the fastest in training, times _STEP_MARGIN.

    Single rows far from both neighbours, up to one in 200, are left out: the steps are those of running medians of
    three rows, and of 99 % of the rows. Motions are positions (N,) [rad|m] and their `room_of`.
    """
    steps, gentle = [np.zeros(1)], [np.zeros(1)]
    for q, room in motions:
        steps.append(np.abs(np.diff(q)) / room[1:])
        if len(q) > 3:
            medians = np.median([q[:-2], q[1:-1], q[2:]], axis=0)
            gentle.append(np.abs(np.diff(medians)) / room[2:-1])
    all_steps = np.concatenate(steps)
    return _STEP_MARGIN * max(float(np.percentile(all_steps, 99.0)), float(np.concatenate(gentle).max()))


@compiled
def find_leaps(
    positions: Floats,  # (N, J) row after row
    limits: Floats,  # (J,) largest step to the next row
    room: Floats,  # (N,) see `room_of`
    seen: Floats,  # (J, 3) last believed position, how many rows leapt since, and the room of these rows
    fast: Floats,  # (1,) steps of another motion, as far as they are remembered
    rejected: Floats,  # (J,) counts rows that were spikes
    away: Flags,  # (N, J) receives whether a row is not believed of a joint
    leaping: Flags,  # (N,) receives whether a row leaps, and is not known to be no spike
) -> None:
    """Find positions that leap farther than a joint can have gone since the last believed one.

    A leap was a spike when one of the next _CONFIRM_ROWS does not leap. In another motion every position is believed.
    """
    for row in range(len(positions)):
        leaping[row] = False
        fast[0] *= _FADE_FACTOR
        believed, added = fast[0] >= _SEVERAL_ROWS, 0.0
        for j in range(len(limits)):
            away[row, j] = True
            seen[j, 2] += room[row]
            if not np.isfinite(positions[row, j]):
                continue
            step = abs(positions[row, j] - seen[j, 0])  # NaN of the first, which is no leap
            if step > limits[j] * seen[j, 2]:
                seen[j, 1] += 1.0
                doubted = seen[j, 1] < _CONFIRM_ROWS
                leaping[row] = leaping[row] or doubted
                if doubted and not believed:
                    continue
            else:
                rejected[j] += seen[j, 1]
            if step > _FAST_SHARE * limits[j] * seen[j, 2]:
                added = 1.0
            away[row, j] = False
            seen[j, 0], seen[j, 1], seen[j, 2] = positions[row, j], 0.0, 0.0
        fast[0] += added
