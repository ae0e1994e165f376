"""Do the rows of commands and measurements belong together? Their lag, by cross-correlation, along the recording."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from catenary.plant import MotionLog
from catenary.verdict.finding import Finding
from catenary.verdict.pairs import OUTLIER_SPREADS, Pairs, scales, slack_of

# Hysteresis looks like a lag, at most half of the unexplained variance of a wrist's joint is gone a row later; rows
# out of step leave 3 to 9000 times as much on a real arm's tight joints. What slack explains as well is no lag.
CLEARLY = 3.0
MOST_ROWS = 64  # that the two are moved against each other
LONGEST = 2.0  # [s] the lag that is looked for where rows are dense: cables, filters and networks lag under one
WINDOWS = 6  # along the recording
SHORTEST = 200  # rows of a window, below which there is one
MOVED = 5.0  # [deg, mm] least range of a joint within a window
FEWEST_WINDOWS = 3  # in which a lag must be clear for two clocks to be told from one shift
MOST_PAIRS = 3000  # rows that a lag is judged by
LEAST_SHARE = 1e-6  # unexplained, that counts as none
APART = 3  # rows by which lags must differ along the recording
WORSE = 1.3  # times more unexplained variance, that rows in step may leave a joint: early rows cancel its hysteresis


def lag_findings(pairs: Pairs, place: NDArray[np.int64]) -> list[Finding]:
    """Find measurements that lie rows before or after their commands.

    Args:
        place: (n,) which command each measurement follows.
    """
    log = pairs.log
    stride = _stride(log)
    whole = _lag(log, place, slice(0, len(log)), stride)
    count = WINDOWS if len(log) >= WINDOWS * SHORTEST else 1
    edges = np.linspace(0, len(log), count + 1).astype(int)
    lags = [_lag(log, place, slice(a, b), stride) for a, b in pairwise(edges)] if count > 1 else [whole]
    known = np.array([0 if lag is None else lag for lag in lags])
    clear = [lag for lag in lags if lag]
    if len(clear) >= FEWEST_WINDOWS and np.ptp(known) >= APART * stride and _one_way(known):
        along = ", ".join(f"{lag}" for lag in known)
        return [
            Finding(
                "clock",
                (),
                f"the measurement lies {along} rows behind the command along {count} equal parts of the recording, "
                "expected the same everywhere",
                "two clocks that run apart, or rows that one of the two lost",
            )
        ]
    lag = whole if whole else (int(np.median(clear)) if len(clear) > count // 2 else 0)
    if not lag and clear:
        parts = ", ".join(str(i + 1) for i, each in enumerate(lags) if each)
        return [
            Finding(
                "shift",
                (),
                f"in part {parts} of {count} equal parts of the recording the measurement lies "
                f"{', '.join(str(each) for each in clear)} rows behind the command",
                "rows that one of the two lost",
            )
        ]
    if not lag:
        return []
    seconds = "" if log.time is None else f" ({lag * float(np.median(np.diff(log.time))):.3g} s)"
    return [
        Finding(
            "shift",
            (),
            f"the measurement fits {CLEARLY:g} times better {abs(lag)} rows{seconds} "
            f"{'earlier' if lag > 0 else 'later'}",
            "rows out of step, or measurements stamped when they arrived",
            f"--shift {lag}",
        )
    ]


def _stride(log: MotionLog) -> int:
    """Return by how many rows to step so that MOST_ROWS steps reach LONGEST."""
    if log.time is None:
        return 1
    step = float(np.median(np.diff(log.time))) if len(log) > 1 else 0.0
    return max(1, round(LONGEST / MOST_ROWS / step)) if step > 0.0 else 1


def _one_way(lags: NDArray[np.int64]) -> bool:
    from scipy.stats import spearmanr

    return bool(abs(spearmanr(np.arange(len(lags)), lags).statistic) > 0.8)


def _lag(log: MotionLog, place: NDArray[np.int64], part: slice, stride: int) -> int | None:
    """Return by how many rows the measurement lies behind the command; 0 unless clearly, None where nothing moves."""
    assert log.q_encoder is not None
    scale = scales(log)
    q, m, ok = (scale * log.q_nominal)[part], (scale * log.q_encoder)[part], log.ok[part]
    joints = [i for i in range(len(place)) if np.ptp(q[:, place[i]]) > MOVED]
    reach = min(MOST_ROWS, len(q) // (8 * stride))
    if not joints or reach < 1 or ok.sum() < 8:
        return None
    lags = stride * np.arange(-reach, reach + 1)
    costs = np.column_stack([_unexplained(q[:, place[i]], m[:, i], ok, lags) for i in joints])
    slack = [_behind_slack(q[:, place[i]], 0.5 * slack_of(q[ok, place[i]], m[ok, i])) for i in joints]
    with_slack = [_unexplained(x, m[:, i], ok, lags[[reach]])[0] for i, x in zip(joints, slack, strict=True)]
    gains = np.minimum(costs[reach], with_slack) - costs  # (lags, joints), logarithms
    mean = gains.mean(axis=1)
    best = int(np.argmax(mean))
    if mean[best] < np.log(CLEARLY) or (gains[best] < -np.log(WORSE)).any():
        return 0
    return int(lags[best])


@compiled
def _behind_slack(command: Floats, half_width: float) -> Floats:
    """Return where a joint is whose motor moves freely by `half_width` to either side, (N,)."""
    joint = command.copy()
    for row in range(1, len(joint)):
        low, high = command[row] - half_width, command[row] + half_width
        joint[row] = min(max(joint[row - 1], low), high)
    return joint


def _unexplained(command: Floats, measured: Floats, ok: NDArray[np.bool_], lags: NDArray[np.int64]) -> Floats:
    """Return logarithms of the share of a measurement's variance that commands each lag earlier leave, (lags,)."""
    apart = measured[ok] - command[ok]
    away = np.abs(apart - np.median(apart))
    rows = np.flatnonzero(ok)[away <= OUTLIER_SPREADS * max(1.4826 * float(np.median(away)), 1.0)]
    rows = rows[:: len(rows) // MOST_PAIRS + 1]  # evenly spread ones tell as much
    left = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        inside = rows[max(0, np.searchsorted(rows, lag)) : np.searchsorted(rows, len(command) + min(0, lag))]
        x, y = command[inside - lag], measured[inside]
        x, y = x - x.mean(), y - y.mean()
        size = float(x @ x) * float(y @ y)
        left[k] = np.log(max(1.0 - float(x @ y) ** 2 / size, LEAST_SHARE)) if size > 0.0 else 0.0
    return left
