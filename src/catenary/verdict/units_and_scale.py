"""Are the numbers in rad and m? By slopes, by what a robot can reach, by what a model was trained on."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel
from catenary.verdict.command_response import MOVED_DEG_MM, Pairs, behind_slack, is_pulled, scales
from catenary.verdict.finding import Finding

_MIN_CORRELATION = 0.5  # correlation from which a slope means something
_MAX_UNEXPLAINED = 0.1  # share of a measurement's variance, from which that no slope is believed
# Times what a wrong scale leaves, below which slack, other joints' friction and a slope of cables are the cause.
# Friction takes motion away (untouched windows of real wrists: 1.9 and less), nothing adds any (1.13 and less).
_LESS_MOTION_RATIO, _MORE_MOTION_RATIO = 2.5, 1.5
# Slopes of measurements on commands reach down to 0.52 on a hysteretic wrist and up to 1.09 on a simulated arm whose
# weight stretches its cables: a unit's factor within a factor of 2.5 is that unit.
_UNIT_FACTOR_RATIO = 2.5
_MAX_SLOPE = 1.15  # slope: no cable makes a joint move farther than this for its motor
_MIN_SLOPE = 0.4  # slope: the most hysteretic wrist loses half of its motion
# the same where slack, friction and other joints explain all but this share of a measurement: then they take none away
_MIN_TIGHT_SLOPE, _TIGHT_UNEXPLAINED = 0.85, 0.002
_LIMIT_MARGIN_SHARE = 0.25  # of its range by which a joint may leave its limits
# times a joint's limit, within which a number in rad or m may be an error of it: a PSM without its instrument turns its
# wrist 2.1 times as far, and inserts 2.3 times as far; in deg or mm not
MAX_LIMIT_RATIO = 3.0
MAX_POSITIONS = {"rad": 6.0 * np.pi, "m": 5.0}  # beyond these a joint without limits is in no rad and no m
_MAX_CABLE_POSITIONS = {"rad": 4.0 * np.pi, "m": 2.0}  # the same of an arm driven by cables, which wind up on drums
# what one rad or m becomes in other units that people record, by name
_UNIT_FACTORS = {"rad": {"deg": np.rad2deg(1.0)}, "m": {"mm": 1e3, "cm": 1e2, "mdeg": np.rad2deg(1.0)}}
_UNIT_WORDS = {
    "deg": "degrees",
    "mm": "millimetres",
    "cm": "centimetres",
    "mdeg": "metres times 180/pi (as RAVEN-II's firmware writes every joint)",
}
_FEW_SHARE = 0.05  # share of a joint's rows
_MAX_RUNS = 8  # of rows that are named to be left out
_TINY_POSITIONS = {"rad": 2.0 * np.pi / np.rad2deg(1.0), "m": 2e-3}  # a turn and two metres, converted twice
# times half the trained range about its middle: a test rarely goes there, degrees and mm nearly always
_BEYOND_RANGES = 5.0
_WITHIN_RANGES = 2.0  # the same of what it becomes in the other unit


def slope_findings(pairs: Pairs, place: Integers) -> Iterator[Finding]:
    """Find measurements, or commands, in another unit or of another scale."""
    wrong: dict[tuple[str, str], list[int]] = {}
    for i in np.flatnonzero(pairs.moved[place]):
        r, slope, name = float(pairs.correlation[i, place[i]]), abs(float(pairs.slope[i, place[i]])), pairs.names[i]
        if abs(r) < _MIN_CORRELATION or is_pulled(pairs, int(i), int(place[i])):
            continue
        # both were scaled to deg and mm; what counts is the ratio of the raw numbers
        si = slope * scales(pairs.log)[place[i]] / scales(pairs.log)[i]
        in_unit = _unit_of(si, pairs.log.joint_units[place[i]])
        if in_unit is not None:
            wrong.setdefault(in_unit, []).append(int(i))
            continue
        if _MIN_TIGHT_SLOPE < si < _MAX_SLOPE:
            continue
        rows, sign = pairs.likely[:, i], np.sign(r)
        before, after = (pairs.m[rows, i] / k - pairs.q[rows, place[i]] for k in (sign, sign * slope))
        if np.std(after) >= np.std(before):  # a mend that leaves larger errors is none
            continue
        to_si = scales(pairs.log)[i] / scales(pairs.log)[place[i]]
        for least in (_MIN_TIGHT_SLOPE, _MIN_SLOPE):
            motion = behind_slack(pairs, int(i), int(place[i]), (least * to_si, _MAX_SLOPE * to_si))
            if motion.unexplained < _TIGHT_UNEXPLAINED:
                break
        if least < si < _MAX_SLOPE:
            continue
        moves = f"the measurement moves {si:.3g} times as far as the command (expected {least:g} to {_MAX_SLOPE:g})"
        if motion.of_cables < (_LESS_MOTION_RATIO if si < 1.0 else _MORE_MOTION_RATIO) * motion.unexplained:
            continue
        if motion.unexplained >= _MAX_UNEXPLAINED:
            says = f"{moves}; slack and other joints leave too little motion to determine its scale"
            yield Finding("scale", (name,), says, "minutes of local motion", refuses=False)
            continue
        remedy = f"--scale {name}={1.0 / si:.4g}"
        yield Finding("scale", (name,), moves, "a transmission ratio or an encoder's counts per turn", remedy)
    for (array, unit), joints in wrong.items():
        slopes = ", ".join(f"{abs(float(pairs.slope[i, place[i]])):.3g}" for i in joints)
        says = f"the measurement moves {slopes} times as far as the command (expected {_MIN_SLOPE:g} to {_MAX_SLOPE:g})"
        culprit = f"the {'measurement' if array == 'q_encoder' else 'command'} in {_UNIT_WORDS[unit]}"
        remedy = _units_option(pairs.log, dict.fromkeys(joints, unit), array)
        yield Finding("units", tuple(pairs.names[i] for i in joints), says, culprit, remedy)


def _unit_of(slope: float, unit: str) -> tuple[str, str] | None:
    """Return the units of both arrays by a slope: the nearest factor by its logarithm."""
    best, distance = None, np.log(_UNIT_FACTOR_RATIO)
    for name, factor in _UNIT_FACTORS[unit].items():
        for array, expected in (("q_encoder", factor), ("q_nominal", 1.0 / factor)):
            off = abs(np.log(slope / expected)) if slope > 0.0 else np.inf
            if off < distance:
                best, distance = (array, name), off
    return best


def _units_option(log: MotionLog, units: dict[int, str], array: str | None = None) -> str:
    """Return the option that says in which unit each joint is, of one array or of all; others are in their own."""
    texts = ",".join(units.get(j, unit) for j, unit in enumerate(log.joint_units))
    return f"--units {array + ':' if array else ''}{texts}"


def limits_of(log: MotionLog, robot: RobotModel | None, largest: dict[str, float]) -> tuple[Floats, Floats]:
    """Return the plausible range of positions (n,) [rad|m]: the robot's limits by joint name, and a margin.

    Args:
        largest: Largest position by unit, for joints without limits.
    """
    high = np.array([largest[unit] for unit in log.joint_units])
    low = -high
    if robot is None:
        return low, high
    for i, (name, unit) in enumerate(zip(log.joint_names, log.joint_units, strict=True)):
        if name in robot.joint_names:
            j = robot.joint_names.index(name)
            if robot.joint_units[j] == unit and np.isfinite(robot.upper[j] - robot.lower[j]):
                slack = _LIMIT_MARGIN_SHARE * (robot.upper[j] - robot.lower[j])
                low[i], high[i] = robot.lower[j] - slack, robot.upper[j] + slack
    return low, high


def range_findings(log: MotionLog, robot: RobotModel | None = None) -> list[Finding]:
    """Find commanded positions that the robot cannot reach, or no robot can where it is not known."""
    low, high = limits_of(log, robot, _MAX_CABLE_POSITIONS)
    least, highest = _reached(log)
    beyond = [i for i in range(len(least)) if not (low[i] <= least[i] and highest[i] <= high[i])]
    reach, far = np.maximum(-least, highest), np.maximum(-low, high)
    far = np.where(far == [_MAX_CABLE_POSITIONS[unit] for unit in log.joint_units], far, MAX_LIMIT_RATIO * far)
    near, stated = reach <= far / MAX_LIMIT_RATIO, {"units", "units:q_nominal"} & log.settled.keys()
    units = (
        {}
        if stated
        else _in_other_units(log, reach > far, near, lambda by: (low <= least / by) & (highest / by <= high))
    )
    return _beyond(log, beyond, units, (low, high), "expected")


def within_reason(log: MotionLog, robot: RobotModel | None) -> tuple[MotionLog, list[Finding]]:
    """Find rows far beyond where an arm can be, few of a joint's, and return the recording with those left out."""
    low, high = limits_of(log, robot, MAX_POSITIONS)
    low, high = 2.0 * low - high, 2.0 * high - low
    arrays = [values for values in (log.q_nominal, log.q_encoder) if values is not None]
    with np.errstate(invalid="ignore"):
        far = np.any([(values < low) | (values > high) for values in arrays], axis=0)
    few = far.mean(axis=0) < _FEW_SHARE  # else in another unit, or another joint's
    far &= few
    if not far.any():
        return log, []
    limited = [np.clip(values, np.where(few, low, -np.inf), np.where(few, high, np.inf)) for values in arrays]
    measured = None if log.q_encoder is None else limited[1]
    left = replace(log, ok=log.ok & ~far.any(axis=1), q_nominal=limited[0], q_encoder=measured)
    far &= log.ok[:, None]
    rows, joints = np.flatnonzero(far.any(axis=1)), np.flatnonzero(far.any(axis=0)).tolist()
    runs = [f"{run[0]}:{run[-1] + 1}" for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if len(run)]
    farthest = [max(float(np.nanmax(np.abs(values[far[:, j], j]))) for values in arrays) for j in joints]
    says = ", ".join(f"up to {x:.3g} {log.joint_units[j]}" for j, x in zip(joints, farthest, strict=True))
    says = f"{len(rows)} row(s) where no arm can be: {says}"
    culprit, remedy = "damaged bytes, or a number that means missing", f"--leave-out {','.join(runs[:_MAX_RUNS])}"
    return left, [Finding("range", tuple(log.joint_names[j] for j in joints), says, culprit, remedy)] * bool(runs)


def tiny_findings(log: MotionLog) -> Iterator[Finding]:
    """Note positions that hardly leave zero: angles in rad that somebody took for degrees, metres for millimetres."""
    reach, moved = np.abs(_reached(log)).max(axis=0), np.ptp(log.q_nominal, axis=0) > 0.0
    for kind, limit in _TINY_POSITIONS.items():
        joints = np.flatnonzero(moved & (np.array(log.joint_units) == kind))
        if len(joints) and (reach[joints] < limit).all():
            says = f"all that moves stays within {reach[joints].max():.2g} {kind} of zero; expected more of an arm"
            culprit = "numbers converted twice: errors printed here are then as many times too small"
            yield Finding("units", tuple(log.joint_names[j] for j in joints), says, culprit, refuses=False)


def trained_findings(log: MotionLog, trained: tuple[Floats, Floats]) -> list[Finding]:
    """Return findings about positions far beyond those trained on that are within them in another unit.

    Args:
        trained: Lowest and highest positions in training (n,) [rad|m]; infinite if unknown.
    """
    low, high = trained
    least, highest = _reached(log)
    known = np.isfinite(high - low) & (high > low)

    @np.errstate(invalid="ignore")
    def farthest(factor: float) -> Floats:
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        return np.asarray(np.maximum(abs(least / factor - middle), abs(highest / factor - middle)) / half)

    far, near = known & (farthest(1.0) > _BEYOND_RANGES), known & (farthest(1.0) < _WITHIN_RANGES)
    units = _in_other_units(log, far, near, lambda by: ~far | (farthest(by) < _WITHIN_RANGES))
    return _beyond(log, [j for j in units if far[j]], units, trained, "the model was trained")


def _in_other_units(log: MotionLog, far: Flags, near: Flags, fits: Callable[[float], Flags]) -> dict[int, str]:
    """Return the unit of each joint of a kind of which some lie `far` off, none that moved is `near`, and all fit."""
    units, moved = dict[int, str](), np.ptp(scales(log) * log.q_nominal, axis=0) > MOVED_DEG_MM
    for kind, factors in _UNIT_FACTORS.items():
        own = np.array(log.joint_units) == kind
        names = [name for name, by in factors.items() if fits(by)[own & moved].all()]
        if names and (own & far).any() and not (own & near & moved).any():
            units |= dict.fromkeys(np.flatnonzero(own).tolist(), names[0])
    return units


def _reached(log: MotionLog) -> Floats:
    """Return least and largest commands (2, n); single rows may be errors of the robot's own messages."""
    return np.asarray(np.percentile(log.q_nominal, [0.5, 99.5], axis=0))


def _beyond(
    log: MotionLog, beyond: list[int], units: dict[int, str], expected: tuple[Floats, Floats], text: str
) -> list[Finding]:
    """Return the sentence on joints beyond the expected range; in other units where `units` has those of all."""
    if not beyond:
        return []
    (least, highest), (low, high), names = _reached(log), expected, tuple(log.joint_names[i] for i in beyond)
    says = ", ".join(
        f"{log.joint_names[i]} from {least[i]:.4g} to {highest[i]:.4g}, {text} between {low[i]:.4g} and {high[i]:.4g} "
        f"{log.joint_units[i]}"
        for i in beyond
    )
    if not set(beyond) <= set(units):
        return [Finding("range", names, says, "another joint's column, another robot, or another zero")]
    spoken = " and ".join(sorted({_UNIT_WORDS[units[i]] for i in beyond}))
    return [Finding("units", names, says, f"numbers in {spoken}", _units_option(log, units))]
