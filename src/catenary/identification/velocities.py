"""Recorded velocities against the derivatives of recorded positions: whether they belong together, and if not, why.

A joint's velocities are normal about what a fault predicts, with a deviation of a tenth of that and `_LEAST_RMS`, or of
their distance from it. Filtered velocities of real arms are .9 to 1.2 times the derivatives, up to 30 % from them.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.robots.model import RobotModel

LEAVE_OUT = "--leave-out qd"
MARGIN = 5.0  # [nats] of evidence from which a fault is reported
_LEAST_RMS = {"rad": 0.02, "m": 0.005}  # [rad/s, m/s] below which a velocity may be only noise
_SHARE, _SLOPE_STD = 0.1, 0.1  # of sound velocities: deviation from the derivative, and of their slope on it
_COMMON_STD = 0.01  # of the slopes of sound recordings without filters
_LEAST_INDEPENDENT = 12  # least number of independent rows
_FACTORS = np.outer([1.0, -1.0], [1.0, 57.29578, 1000.0, 100.0, 1.0 / 57.29578, 1e-3, 0.01]).ravel()  # of units
_SNAPPED = 0.2  # relative distance of a factor from that of a unit
_EXPLAINED = 0.5  # of the squared velocity, that a factor explains at least
_FACTOR_PRICE, _PRICE = 5.0, 4.0  # [nats]
_LATE_S = np.linspace(-0.3, 0.3, 61)


class VelocityFault(NamedTuple):
    """A reason why velocities are not the derivatives of positions."""

    gain: float  # [nats] of evidence over velocities that are
    joints: tuple[int, ...]  # whose derivatives are to be used instead
    says: str
    remedy: str = ""  # empty where it is a note


def velocity_faults(model: RobotModel, qd: Floats, derived: Floats, step: float) -> Iterator[VelocityFault]:
    """Yield what may be wrong with velocities; without a remedy where they can be used as they are.

    Args:
        model: The robot.
        qd, derived: Velocities as recorded, and by the positions (N, n) [rad/s or m/s].
        step: Time between rows [s].
    """
    names, n = model.joint_names, model.n
    least = np.array([_LEAST_RMS[unit] for unit in model.joint_units])
    reversals = np.count_nonzero(np.diff(np.sign(np.diff(derived, axis=0)), axis=0), axis=0)
    counted = np.clip(reversals, _LEAST_INDEPENDENT, max(_LEAST_INDEPENDENT, len(qd) / _LEAST_INDEPENDENT))
    moves = np.flatnonzero(np.sqrt(np.mean(derived**2, axis=0)) > least).tolist()
    if not moves:
        return

    def log(predicted: Floats, i: int, measured: Floats = qd) -> float:
        off = np.mean((measured[:, i] - predicted) ** 2) + _SHARE**2 * np.mean(predicted**2) + least[i] ** 2
        return -0.5 * float(counted[i] * np.log(off))

    slope = np.sum(derived * qd, axis=0) / np.maximum(np.sum(derived**2, axis=0), 1e-300)
    unlikely = 0.5 * ((slope - 1.0) / _SLOPE_STD) ** 2
    sound = {i: max(log(derived[:, i], i), log(slope[i] * derived[:, i], i) - unlikely[i]) for i in moves}
    faults = dict[int, tuple[float, str, str]]()
    for i in moves:
        tried = [(log(0.0 * derived[:, i], i), "do not follow positions", LEAVE_OUT)]
        factor, is_unit = _snapped(float(slope[i]))
        if np.sum((qd[:, i] - factor * derived[:, i]) ** 2) < (1.0 - _EXPLAINED) * np.sum(qd[:, i] ** 2):
            option = f"--scale qd:{names[i]}={1.0 / factor:.4g}" if is_unit else LEAVE_OUT
            option = f"--sign qd:{names[i]}" if factor == -1.0 else option
            says = f"are {factor:.3g} times the derivatives of positions{'' if is_unit else _DOUBT}"
            tried.append((log(factor * derived[:, i], i) - _FACTOR_PRICE, says, option))
        for j in (j for j in moves if j != i):
            value, (a, b) = log(derived[:, j], i) - float(np.log(n)), sorted((i, j))
            tried.append((value, f"are those of {names[j]}", f"--swap qd:{names[a]},{names[b]}"))
        value, says, option = max(tried)
        value -= sound[i] + float(np.log(3.0 * n))
        if value > 0.0:
            faults[i] = value, says, option
    if faults:
        gains, texts, options = zip(*faults.values(), strict=True)
        one_way = any("--swap" in option and options.count(option) < 2 for option in options)
        remedy = LEAVE_OUT if one_way or LEAVE_OUT in options else " ".join(dict.fromkeys(options))
        whose = {text: ", ".join(names[i] for i, fault in faults.items() if fault[1] == text) for text in texts}
        says = "; ".join(f"velocities of {joints} {text}" for text, joints in whose.items())
        yield VelocityFault(float(sum(gains)), tuple(faults), says, remedy)
    common = float(np.median(slope[moves]))
    apart = [float(np.sum((slope[moves] - about) ** 2)) + len(moves) * _COMMON_STD**2 for about in (1.0, common)]
    says = f"velocities are {common:.3g} times the derivatives of positions{_DOUBT}"
    yield VelocityFault(0.5 * len(moves) * float(np.log(apart[0] / apart[1])) - _PRICE, (), says)

    def gain(late: int) -> float:
        kept, before = slice(max(late, 0), len(qd) + min(late, 0)), slice(max(-late, 0), len(qd) - max(late, 0))
        return float(sum(log(derived[before, i], i, qd[kept]) - sound[i] for i in moves)) - _PRICE

    late = max((round(s / step) for s in _LATE_S if abs(s / step) < 0.5 * len(qd)), key=gain)
    off = f"{abs(late) * step * 1e3:.0f} ms too {'late' if late > 0 else 'early'}"
    says = f"velocities come {off} for the positions; {LEAVE_OUT} takes derivatives of positions"
    yield VelocityFault(gain(late), tuple(range(n)), says)


_DOUBT = ": is the time or the rate wrong?"


def _snapped(slope: float) -> tuple[float, bool]:
    """Return a factor, or that of the unit or sign nearby, and whether it is one of those."""
    nearest = float(_FACTORS[np.argmin(np.abs(slope / _FACTORS - 1.0))])
    is_unit = abs(slope / nearest - 1.0) < _SNAPPED
    return (nearest if is_unit else slope), is_unit
