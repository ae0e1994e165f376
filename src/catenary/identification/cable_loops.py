"""Cable properties from reversals: friction on both sides, stiffness, lost motion.

When a motor turns back, friction holds the joint until the cable has wound up the other way. While the encoder at the
joint stands, gravity, run-out and errors of ratio stand too: all that the motor moves stretches the cable, and all that
its torque changes, less the motor's own friction, is the cable's.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.stats import t as student

from catenary.arrays import Floats, spread
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.units import DISPLAY
from catenary.verdict.command_response import MOVED_DEG_MM, play
from catenary.verdict.finding import Finding

_BLOCK_COUNT, _MIN_BLOCKS = 8, 4  # of time, whose spread gives the intervals; with reversals (rows of a slope, too)
_TURN_SHARE = 0.05  # share of a joint's range that it must go back by for a reversal to count
_SMOOTHING_S = 0.01  # [s] to either side, over which readings are averaged; speeds over thrice that
# of a joint's RMS speed, of its motor's: slower rows tell nothing of friction
_MOVING_SHARE, _FOLLOWING_SHARE = 0.25, 0.5
_OWN_VARIANCE_SHARE = 0.1  # of the variance of a joint's direction that pose and speed must leave
# of what an encoder jumps by; of that, the least lost motion that is reported
_STANDING_JUMPS, _BACKLASH_JUMPS = 3.0, 4.0
_EVEN_RATIO = 2.0  # at most, between the 16th and 84th percentile of lost motion, where a joint moves alone
# difference of a wind-up's halves that is none; factor from which neither is a stiffness
_SAME_DIFFERENCE, _APART_FACTOR = 0.3, 3.0
_MIN_WINDUP_S = 0.3  # [s] that a wind-up lasts at least: in a faster one rotor inertia looks like friction
_MAX_ROWS = 6000
_NO_BACKLASH_TEXT = (
    "backlash: at most the lost motion; it is not separated from stretch, and a load that keeps a cable taut hides it"
)
_WINDUP_PARTS = (0.1, 0.9), (0.1, 0.5), (0.5, 0.9)  # of a wind-up


class Interval(NamedTuple):
    """An estimate with its 95 % interval from blocks of time; NaN if the data do not determine it."""

    value: float = np.nan
    low: float = np.nan
    high: float = np.nan


class CableLoop(NamedTuple):
    """Cable properties of one joint from a recording, at the joint: rad and Nm, or m and N."""

    joint: str
    unit: str
    friction: Interval  # Coulomb friction between the motor's torque and the load
    joint_side: Interval = Interval()  # the part that stretches the cable: joint, and inside the cable
    motor_side: Interval = Interval()
    stiffness: Interval = Interval()  # over a reversal
    width: Interval = Interval()  # lost motion at a reversal: the hysteresis between motor and joint
    following: float = np.nan  # RMS of setpoint less reported position; NaN without setpoints
    reversals: int = 0
    untold: tuple[str, ...] = ()  # what the data do not determine, and why


def cable_loops(log: MotionLog) -> tuple[list[CableLoop], list[Finding]]:
    """Return the findings about each joint's cable, and about friction at the drive, from a recording with torques."""
    if log.tau is None or log.time is None:
        raise InputError(f'recording "{log.name}": friction needs torques (tau) and time stamps')
    motor = log.q_nominal if log.q_reported is None else log.q_reported
    half = _SMOOTHING_S / float(np.median(np.diff(log.time)))
    q, tau = _smoothed(motor, half), _smoothed(log.tau, half)
    seen = None if log.q_encoder is None or not log.ok.all() else log.q_encoder
    x = q if seen is None else _smoothed(seen, half)
    missed = np.sqrt(np.mean((log.q_nominal - motor) ** 2, axis=0)) if log.q_reported is not None else q[0] * np.nan
    loops, findings = [], []
    for j, (joint, unit) in enumerate(zip(log.joint_names, log.joint_units, strict=True)):
        turns = _turns(np.ascontiguousarray(q[:, j]))
        friction, untold = Interval(), ["friction: the joint hardly moves"]
        if moves := DISPLAY[unit][1] * np.ptp(q[:, j]) > MOVED_DEG_MM:
            friction, untold = _friction(log.time, q, x[:, j], tau[:, j], j, half)
        loop = CableLoop(joint, unit, friction, following=float(missed[j]), reversals=len(turns))
        if seen is None or not moves:
            untold += ["stiffness, hysteresis: no encoder on every row, or the joint hardly moves"]
        else:
            jumps = float(np.median(np.abs(np.diff(seen[:, j], n=2))))
            fine = _STANDING_JUMPS * max(jumps, 1e-5 * float(np.ptp(q[:, j])))
            rows = _windups(log.time, q[:, j], x[:, j], tau[:, j], turns, fine)
            block = np.floor((rows[:, 0] - log.time[0]) / (log.time[-1] - log.time[0] + 1e-9) * _BLOCK_COUNT)
            loop, more = _of_windups(loop, rows[:, 1:], block, fine)
            untold = [*untold, *more]
        if friction.high < 0.0:
            says = f"friction of {friction.value:.3g} drives the joint"
            findings += [Finding("sign", (joint,), says, "torques negated", f"--sign tau:{joint}")]
        loops.append(loop._replace(untold=tuple(untold)))
    return loops, findings


def _smoothed(values: Floats, half: float) -> Floats:
    """Return running means (N, n) over so many rows to either side."""
    return uniform_filter1d(values, 2 * round(half) + 1, axis=0, mode="nearest")


def _turns(q: Floats) -> list[tuple[int, int]]:
    """Return the rows at which a motor turns back, and the way in which it goes on, 1 or -1."""
    way = np.sign(np.diff(play(q, 0.5 * _TURN_SHARE * float(np.ptp(q))), prepend=q[0]))
    rows = np.flatnonzero(way)
    changes = rows[1:][np.diff(way[rows]) != 0.0]
    pairs = zip([0, *changes[:-1]], changes, strict=True) if len(changes) else ()
    return [(a + int(np.argmax(-way[b] * q[a : b + 1])), int(way[b])) for a, b in pairs]


def _friction(time: Floats, q: Floats, x: Floats, tau: Floats, j: int, half: float) -> tuple[Interval, list[str]]:
    """Return half of the torque's difference between both ways of travel at equal poses.

    Where a joint's direction follows from pose and speed, two laws explain the torque: with viscous friction, inertia
    and squares of the pose, and without. The interval then holds both.
    """
    qd = _smoothed(np.gradient(np.column_stack([q[:, j], x]), time, axis=0), max(1.0, 3.0 * half))
    qdd = _smoothed(np.gradient(qd[:, :1], time, axis=0), max(1.0, 3.0 * half))[:, 0]
    radius = _TURN_SHARE * float(np.ptp(q[:, j]))
    past = np.abs(q[:, j] - play(np.ascontiguousarray(q[:, j]), radius)) > 0.999 * radius  # beyond the last reversal
    past &= (qd[:, 1] * np.sign(qd[:, 0]) > _FOLLOWING_SHARE * np.abs(qd[:, 0])) | (qd[:, 1] == qd[:, 0])
    rows = np.flatnonzero(past & (np.abs(qd[:, 0]) > _MOVING_SHARE * np.sqrt(np.mean(qd[:, 0] ** 2))))
    rows = rows[spread(len(rows), _MAX_ROWS)]
    side, own = np.sign(qd[rows, 0]), rows * _BLOCK_COUNT // len(q)
    if any(len(np.unique(side[own == b])) < 2 for b in range(_BLOCK_COUNT)):
        return Interval(), [f"friction: the joint does not move both ways in each of {_BLOCK_COUNT} blocks of time"]
    z = (q[rows] - q.mean(axis=0)) / np.maximum(np.ptp(q, axis=0), 1e-9)
    lean = np.column_stack([side, np.ones(len(rows)), z])
    squares = [z[:, a] * z[:, b] for a in range(z.shape[1]) for b in range(a, z.shape[1])]
    full = np.column_stack([lean, qd[rows, 0] / np.ptp(qd[:, 0]), qdd[rows] / max(float(np.ptp(qdd)), 1e-9), *squares])
    left = side - full[:, 1:] @ np.linalg.lstsq(full[:, 1:], side, rcond=None)[0]
    whole = _jackknife(full, tau[rows], own)
    if np.mean(left**2) >= _OWN_VARIANCE_SHARE:
        return whole, []
    simple = _jackknife(lean, tau[rows], own)
    estimate = simple._replace(low=min(simple.low, whole.low), high=max(simple.high, whole.high))

    return estimate, [
        "friction: its side follows from pose and speed in this motion; viscous friction is not separated"
    ]


def _jackknife(X: Floats, y: Floats, block: NDArray[np.int64]) -> Interval:
    """Return the first weight of a fit, with an interval by leaving out each block in turn [Tukey 1958]."""
    whole = _first_weight(X, y)
    without = np.array([_first_weight(X[block != b], y[block != b]) for b in range(_BLOCK_COUNT)])
    reach = student.ppf(0.975, _BLOCK_COUNT - 1) * np.sqrt(
        (_BLOCK_COUNT - 1) / _BLOCK_COUNT * np.sum((without - without.mean()) ** 2)
    )
    return Interval(whole, whole - float(reach), whole + float(reach))


def _first_weight(X: Floats, y: Floats) -> float:
    """Return the first weight of a fit whose loss is linear for large errors [Huber 1964]."""
    share = np.ones_like(y)
    for _ in range(5):
        weights = np.linalg.lstsq(X * share[:, np.newaxis], y * share, rcond=None)[0]
        left = np.abs(y - X @ weights)
        share = np.sqrt(np.minimum(1.0, 2.0 * np.median(left) / np.maximum(left, 1e-12)))
    return float(weights[0])


def _windups(time: Floats, q: Floats, x: Floats, tau: Floats, turns: list[tuple[int, int]], fine: float) -> Floats:
    """Return measures of each motor reversal (q) until its joint (x) has moved by `fine`, (R, 8).

    That is: when, the lost motion, by how much the torque swings once the motor's own friction has turned, as the first
    half's line tells it and as the row at a tenth does, the slopes of _WINDUP_PARTS, and the time that it takes.
    """
    windups = []
    for (row, way), end in zip(turns, [row for row, _ in (*turns, (len(q), 0))][1:], strict=True):
        joint = way * (x[row:end] - x[row])
        near = np.flatnonzero(way * (q[row:end] - q[row]) > _TURN_SHARE * np.ptp(q))
        start = int(np.argmin(joint[: max(3, near[0] if len(near) else len(joint))]))
        goes = np.flatnonzero(joint[start:] > joint[start] + fine)
        if len(goes):
            rows = slice(row, row + start + int(goes[0]) + 1)
            stretch, torque = way * (q - x)[rows], way * tau[rows]
            stretch = stretch - stretch[0]
            wide = stretch[-1] > _BACKLASH_JUMPS * fine
            lines = [_line(stretch, torque, *part) if wide else (np.nan, np.nan) for part in _WINDUP_PARTS]
            early = (torque[-1] - torque[np.argmax(stretch >= 0.1 * stretch[-1])]) / 0.9
            until, slopes = time[rows][-1], [slope for slope, _ in lines]
            windups.append((time[row], stretch[-1], torque[-1] - lines[1][1], early, *slopes, until - time[row]))
    return np.array(windups).reshape(-1, 8)


def _line(stretch: Floats, torque: Floats, first: float, last: float) -> tuple[float, float]:
    """Return slope and torque at no stretch of the line through part of a wind-up."""
    rows = (stretch >= first * stretch[-1]) & (stretch <= last * stretch[-1])
    if rows.sum() < _MIN_BLOCKS or np.ptp(stretch[rows]) == 0.0:
        return np.nan, np.nan
    slope, start = np.polyfit(stretch[rows], torque[rows], 1)
    return float(slope), float(start)


def _of_blocks(values: Floats, block: Floats) -> Interval:
    """Return the mean of the blocks' medians, with its interval."""
    finite = np.isfinite(values)
    medians = np.array([np.median(values[finite & (block == b)]) for b in np.unique(block[finite])])
    if len(medians) < _MIN_BLOCKS:
        return Interval()
    mean, reach = medians.mean(), student.ppf(0.975, len(medians) - 1) * medians.std(ddof=1) / np.sqrt(len(medians))
    return Interval(*map(float, (mean, mean - reach, mean + reach)))


def _of_windups(loop: CableLoop, rows: Floats, block: Floats, fine: float) -> tuple[CableLoop, list[str]]:
    """Return a joint's cable parameters from wind-ups (R, 7), and the reasons for those that are missing."""
    width, swing, early, whole, first, second, lasts = (_of_blocks(column, block) for column in rows.T)
    if not np.isfinite(width.value):
        return loop, [f"stiffness, hysteresis: reversals in fewer than {_MIN_BLOCKS} of {_BLOCK_COUNT} blocks of time"]
    low, high = np.percentile(rows[:, 0], [16.0, 84.0])
    if width.value < _BACKLASH_JUMPS * fine:
        loop = loop._replace(width=Interval(width.value, 0.0, max(width.high, _BACKLASH_JUMPS * fine)))
        return loop, [f"stiffness, sides of friction: the encoder resolves {fine:.2g} {loop.unit}"]
    if high > _EVEN_RATIO * low:
        why = f"lost motion is {low:.2g} to {high:.2g} {loop.unit}: other joints move this cable, or it is little"
        return loop, [f"stiffness, hysteresis: {why}; record one joint at a time"]
    if not all(v > 0.0 for v in (whole.low, second.low, first.value, _APART_FACTOR * first.value - second.value)):
        why = "the torque does not rise evenly with the stretch, as in a backlash, or rows are too few"
        return loop._replace(width=width), [f"stiffness, sides of friction: {why}", _NO_BACKLASH_TEXT]
    last = second.value + 0.75 * (second.value - first.value)  # where the trend leads at the wind-up's end
    ends = [max(last, 0.0), *(end for ends in (whole, first, second) for end in ends[1:])]
    loop, untold = loop._replace(width=width, stiffness=Interval(whole.value, min(ends), max(ends))), []
    if lasts.value >= _MIN_WINDUP_S:
        side = Interval(0.5 * swing.value, 0.5 * min(swing.low, early.low), 0.5 * max(swing.high, early.high))
        motor_side = Interval(*(loop.friction[a] - side[b] for a, b in ((0, 0), (1, 2), (2, 1))))
        loop = loop._replace(joint_side=side, motor_side=motor_side)
    else:
        untold = [f"sides of friction: wind-ups of {lasts.value:.2g} s are too fast, move more slowly"]
    if abs(first.value - second.value) > _SAME_DIFFERENCE * whole.value:
        why = "friction or hysteresis inside the cable" if first.value > second.value else "backlash, or soft at first"
        untold += [f"one stiffness: it is {first.value:.4g}, then {second.value:.4g} along a wind-up; {why}"]
    return loop, [*untold, _NO_BACKLASH_TEXT]
