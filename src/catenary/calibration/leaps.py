"""Positions that no joint can have reached since the row before: they leave the memory of a calibration model alone."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.kernels import Integers
from catenary.kernels.compiled import compiled
from catenary.plant import MotionLog

MARGIN = 4.0  # times the fastest step of the training rows: other motions may be faster
ANY = 1e300  # the limit of a joint whose steps are not known: finite, as C writes it too
CONFIRM = 3  # leaps in a row, each within a step of the one before, that are the truth: the joint is there


def room_of(log: MotionLog, period: float | None) -> Floats:
    """Return for how many rows, `period` [s] apart, each row of a log had time to move, (N,): one or more."""
    room = np.ones(len(log))
    if period is not None and log.time is not None:
        room[1:] = np.maximum(1.0, np.diff(log.time) / period)
    return room


def largest_step(motions: Sequence[tuple[Floats, Floats]]) -> float:
    """Return how far a joint may go from one row to the next: its fastest step in training rows, times MARGIN.

    Single rows far from both neighbours, up to one in 200, are left out: the steps are those of running medians of
    three rows, and of 99 % of the rows.

    Args:
        motions: Positions (N,) of one motion each [rad|m], and their `room_of`.
    """
    steps, gentle = [np.zeros(1)], [np.zeros(1)]
    for q, room in motions:
        steps.append(np.abs(np.diff(q)) / room[1:])
        if len(q) > 3:
            medians = np.median([q[:-2], q[1:-1], q[2:]], axis=0)
            gentle.append(np.abs(np.diff(medians)) / room[2:-1])
    all_steps = np.concatenate(steps)
    return MARGIN * max(float(np.percentile(all_steps, 99.0)), float(np.concatenate(gentle).max()))


@compiled
def without_leaps(
    signals: Floats,
    joints: Integers,
    limits: Floats,
    room: Floats,
    seen: Floats,
    rejected: Floats,
    believed: Floats,
) -> None:
    """Write the positions that are believed: those given, but the last believed ones in place of leaps.

    A leap is farther from the last believed position than the joint can have gone since. It is the truth after all
    when CONFIRM of them in a row agree. What is not finite stays so, and changes nothing.

    Args:
        signals: (N, S) what the robot reports, row after row.
        joints: (J,) which signals these positions are.
        limits: (J,) largest step to the next row.
        room: (N,) see `room_of`.
        seen: (J, 4) last believed position, last leap, how many leaps agree, room since the former.
        rejected: (J,) counts leaps.
        believed: (N, J) receives the positions.
    """
    for row in range(len(signals)):
        for j in range(len(joints)):
            q = signals[row, joints[j]]
            believed[row, j] = q
            seen[j, 3] += room[row]
            if not np.isfinite(q):
                continue
            if abs(q - seen[j, 0]) > limits[j] * seen[j, 3]:  # never of the first, which is NaN
                agrees = abs(q - seen[j, 1]) <= limits[j] * room[row]
                seen[j, 1] = q
                seen[j, 2] = seen[j, 2] + 1.0 if agrees else 1.0
                if seen[j, 2] < CONFIRM:
                    believed[row, j] = seen[j, 0]
                    rejected[j] += 1.0
                    continue
            seen[j, 0], seen[j, 1], seen[j, 2], seen[j, 3] = q, np.nan, 0.0, 0.0
