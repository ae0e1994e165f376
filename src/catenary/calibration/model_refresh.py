"""A fitted model brought up to date by minutes of a new day: what drifted moves, what is still true stays.

Friction of coupled joints comes first: where a day shows another level of it (friction_level.py), the model is taken
there. Then each joint gets a new zero and scale, slopes of the correction and of the position, unless contiguous blocks
of the new rows that these were not fitted to show no smaller mean RMSE than without, by one standard error of the
paired differences (Breiman et al., Classification and Regression Trees, 1984, 3.4.3).

Blocks of one minute tell nothing of where that minute did not go, and neighbouring rows are hardly independent. A joint
is seen anew once it has swept half of the trained range and come back: before, a zero cannot be told from the side of
the slack on which it lies. So zero and scale are the mean of what is known once minutes are over [Bayesian linear
regression; Bishop, Pattern Recognition and Machine Learning, 2006, section 3.3]: a look for each two sweeps, with an
error as large as the model claims or these rows leave, and a drift that may be as large as what the rows show, of the
zero as of each slope over the trained range.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.conformal import estimate_intervals, rmse_of_other_minutes
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.evaluate import CrossValidation
from catenary.calibration.expansion import Expansion
from catenary.calibration.fit_rows import largest_shown
from catenary.calibration.friction_level import DayLevel
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import AnyPredictor, CalibrationModel, JointGroup
from catenary.calibration.predictors import Constant, Linear, Quadratic
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.calibration.valid_range import MIN_RANGE, ValidRange, standardisation
from catenary.errors import InputError
from catenary.units import DISPLAY

UNCHANGED, ZERO_AND_SCALE, FRICTION_LEVEL = "nothing", "zero and scale", "friction level"
REFRESH_BLOCKS = 8  # of time, on which candidates are judged
MIN_REFRESH_ROWS = 40  # five a block
_RESOLUTION_SI = 1e-9  # [rad|m] differences that no encoder shows
_SCALE_RIDGE = 1e-3  # of the rows' own spread: correction and position may resemble each other
_SWEEP_SHARE = 0.5  # of the trained range, from one side to the other, that makes a sweep
MIN_SWEEPS = 10  # of a joint, of which fewer are told
_CLOSE_SHARE = 0.01  # of the best candidate's error: what is better by less is not worth a larger change


@dataclass(frozen=True)
class JointChange:
    """What a refresh did to one joint, as the card tells it, in deg or mm."""

    name: str
    unit: str  # "deg" or "mm"
    change: str  # UNCHANGED or ZERO_AND_SCALE, or FRICTION_LEVEL and one of these
    moved: float  # mean change of the correction over the new rows
    rmse_before: float  # of the old model on the new rows
    rmse_after: float  # on blocks that the refreshed model's candidate was not fitted to
    rmse_low: float  # between these the RMSE of other minutes of the day lies, of motion like these
    rmse_high: float


class Refreshed(NamedTuple):
    """A model brought up to date, what became of each joint, and what a reader must know."""

    model: CalibrationModel
    changes: tuple[JointChange, ...]
    notes: tuple[str, ...]
    before: Floats  # (N, n) errors of the old model on the new rows [rad|m]
    left: Floats  # (N, n) on blocks that the refreshed model's candidates were not fitted to [rad|m]


def refresh_model(model: CalibrationModel, data: CalibrationData, day: DayLevel | None = None) -> Refreshed:
    """Bring a model up to date with rows of a new day, or those of `day`, at its level of friction.

    Rows outside the valid range count, and widen it, where the predictor with a new zero is nearer to the truth there
    than the fixed offset with one, on blocks, for every joint of its group. Elsewhere the predictor is changed by the
    rows inside alone. Intervals are the wider of the old ones and those of errors left on blocks, or none.
    """
    model, data = (model, data) if day is None else (day.model, day.data)
    data.require(model, model.features)
    if len(data) < MIN_REFRESH_ROWS:
        raise InputError(f"data: {len(data)} usable rows of the new day, expected at least {MIN_REFRESH_ROWS}")
    block = np.arange(len(data)) * REFRESH_BLOCKS // len(data)
    inside = model.inside(data.X)
    offset, left = model.offset.copy(), np.empty_like(data.error)
    groups: list[JointGroup] = []
    notes: list[str] = []
    found: dict[int, str] = {}
    for group in model.groups:
        new_group, how, of_group, moved, said = _refresh_group(model, group, data, block, inside[:, group.joints[0]])
        groups.append(new_group)
        left[:, list(group.joints)] = of_group
        notes += said
        offset[list(group.joints)] += moved
        found |= dict(zip(group.joints, how, strict=True))
    old = model.correction(data.X, data.q_nominal) if day is None else data.error - day.before
    if day is not None:
        told = ", ".join(f"{name} {factor:.2f}" for name, factor in day.factors.items())
        notes.append(f"friction of this day over the model's: {told}")
        found |= {j: FRICTION_LEVEL if found[j] == UNCHANGED else f"{FRICTION_LEVEL}, {found[j]}" for j in day.joints}
    refreshed = replace(model, offset=offset, largest=np.full(len(offset), ANY_SIZE), groups=tuple(groups))
    change = refreshed.correction(data.X, data.q_nominal) - old
    # where the new rows did not go, corrections moved as far as on them
    largest = np.maximum(model.largest + np.abs(change).max(axis=0), largest_shown(refreshed, data))
    refreshed = replace(refreshed, largest=largest)
    if model.intervals is not None:
        inside = refreshed.correct(data.X, data.q_nominal)[1]
        errors = CrossValidation((), data.error - offset, left, inside, data.recording)
        was, new = model.intervals, estimate_intervals(errors, level=model.intervals.level)
        if new is None:
            notes.append(f"no intervals any more: {len(data)} new rows are too few to say whether they hold")
        else:  # minutes show where intervals are too narrow, not that they are too wide
            near = np.maximum(was.inside, new.inside)
            new = Intervals(was.level, near, np.maximum(near, np.maximum(was.outside, new.outside)))
        refreshed = replace(refreshed, intervals=new)
    scale = np.array([DISPLAY[unit][1] for unit in model.joint_units])
    before, after = (np.sqrt(np.mean(np.square(e), axis=0)) for e in (data.error - old, left))
    promise = rmse_of_other_minutes(left)
    numbers = (scale * np.array([change.mean(axis=0), before, after, *promise])).T.tolist()
    changes = tuple(
        JointChange(name, DISPLAY[unit][0], found[j], *numbers[j])
        for j, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True))
    )
    return Refreshed(refreshed, changes, tuple(notes), data.error - old, left)


def adjusted(predictor: AnyPredictor, scale: Floats, bias: Floats, linear: Floats) -> AnyPredictor:
    """Return a predictor of scale y + bias + X @ linear; a constant becomes linear, a network gets a line beside it."""
    if isinstance(predictor, Constant):
        value = scale * predictor.value + bias
        return Linear(linear, value) if linear.any() else Constant(value)
    if isinstance(predictor, Linear):
        return Linear(scale * predictor.weights + linear, scale * predictor.bias + bias)
    if isinstance(predictor, Quadratic):
        return replace(
            predictor,
            linear=scale * predictor.linear + predictor.scale[:, None] * linear,
            quadratic=scale * predictor.quadratic,
            bias=scale * predictor.bias + bias + predictor.mean @ linear,
        )
    if isinstance(predictor, Expansion):
        weights, terms, width = scale * predictor.weights, predictor.terms, len(linear)
        weights[:width] += terms.scale[:, None] * linear  # its first terms are the features
        return replace(predictor, weights=weights, bias=scale * predictor.bias + bias + terms.middle @ linear)
    skip = predictor.skip
    if skip is not None:
        skip = Linear(scale * skip.weights + linear, scale * skip.bias)
    elif linear.any():
        skip = Linear(linear, np.zeros(len(scale)))
    return replace(
        predictor,
        weights=(*predictor.weights[:-1], scale * predictor.weights[-1]),
        biases=(*predictor.biases[:-1], scale * predictor.biases[-1]),
        out_mean=scale * predictor.out_mean + bias,
        skip=skip,
    )


def _refresh_group(
    model: CalibrationModel, group: JointGroup, data: CalibrationData, block: Integers, inside: Flags
) -> tuple[JointGroup, list[str], Floats, Floats, list[str]]:
    """Return the new group, what became of its joints, errors left (N, m) on blocks, the offset's move, and notes."""
    joints = list(group.joints)
    names = ", ".join(model.joint_names[j] for j in joints)
    X, q = np.ascontiguousarray(data.X[:, group.columns]), data.q_nominal[:, joints]
    correction = group.predictor.predict(X) - (q if model.target == "position" else 0.0)
    error = data.error[:, joints]
    of_offset, notes = error - model.offset[joints], list[str]()
    outside = ~inside
    if outside.any():
        share = f"{names}: {outside.mean():.1%} of the new rows lie outside the valid range"
        a, b = (
            [np.square(_left_on_blocks(_zero_of(block), each, block)[outside]).mean() for each in errors.T]
            for errors in (error - correction, of_offset)
        )
        if np.less_equal(a, b).all():
            notes = [f"{share}; the model holds there, and its range now takes them in"]
            inside = np.ones(len(data), dtype=bool)
            group = replace(group, valid_range=_widened(group.valid_range, data.X[:, group.watched]))
        else:
            notes = [f"{share}, where the fixed offset is used; the model does not hold there"]
    rows = np.flatnonzero(inside)
    if len(rows) < MIN_REFRESH_ROWS:
        return _only_offset(group, of_offset, block, notes)
    residual, parts = (error - correction)[rows], block[rows]
    how, left, own = list[str](), of_offset.copy(), [model.features.names[c] for c in group.columns]
    scale, bias, linear = np.ones(len(joints)), np.zeros(len(joints)), np.zeros((len(group.columns), len(joints)))
    for k, joint in enumerate(joints):
        position = f"q:{model.joint_names[joint]}"
        place = own.index(position) if position in own else None
        trained = _trained(group, model, joint)
        seen = _motion_shown(data.q_nominal[:, joint], trained)
        held = _held(model, joint, correction[rows, k], q[rows, k], place, trained, seen[1])
        without = _left_on_blocks(held, residual[:, k], parts)
        moved_it = pays(residual[:, k], without, parts)
        how.append(ZERO_AND_SCALE if moved_it else UNCHANGED)
        left[rows, k] = without if moved_it else residual[:, k]
        if moved_it:
            if seen[1] < MIN_SWEEPS:
                notes.append(_too_local(model.joint_names[joint], seen))
            columns, regression = held
            slopes, bias[k] = regression(columns, residual[:, k])
            if len(slopes):
                scale[k] += slopes[0]
                if place is not None:
                    # a model of positions gives q + correction: what its slope would take of q is given back
                    linear[place, k] = slopes[1] - (slopes[0] if model.target == "position" else 0.0)
    predictor = adjusted(group.predictor, scale, bias, linear)
    moved = (predictor.predict(X[rows]) - group.predictor.predict(X[rows])).mean(axis=0)
    left[outside & ~inside] -= moved
    return replace(group, predictor=predictor), how, left, moved, notes


def _trained(group: JointGroup, model: CalibrationModel, joint: int) -> tuple[float, float] | None:
    """Return mean and range of a joint's positions in training; None where the model asks nothing of them."""
    name, watched = f"q:{model.joint_names[joint]}", [model.features.names[c] for c in group.watched]
    if name not in watched:
        return None
    place, known = watched.index(name), group.valid_range
    return float(known.mean[place]), float(known.upper[place] - known.lower[place]) * known.seen


def _motion_shown(q: Floats, trained: tuple[float, float] | None) -> tuple[float, int]:
    """Return which share of a joint's trained range new rows show, and how often they sweep half of it or more."""
    if trained is None:
        return 1.0, len(q)  # nothing is known of its training
    box = trained[1]
    sweeps, low, high, up = 0, q[0], q[0], None
    for value in q.tolist():
        if up is not True and value - low >= _SWEEP_SHARE * box:
            sweeps, up, high = sweeps + 1, True, value
        elif up is not False and high - value >= _SWEEP_SHARE * box:
            sweeps, up, low = sweeps + 1, False, value
        low, high = min(low, value), max(high, value)
    return float(np.ptp(q)) / max(box, _RESOLUTION_SI), sweeps


def _too_local(name: str, seen: tuple[float, int]) -> str:
    return (
        f"{name}: these minutes are too local for all of a change of {ZERO_AND_SCALE}: they show {seen[0]:.0%} of the "
        f"trained range in {seen[1]} sweeps, expected {MIN_SWEEPS} sweeps; drive `catenary excite --refresh`"
    )


def _only_offset(
    group: JointGroup, of_offset: Floats, block: Integers, notes: list[str]
) -> tuple[JointGroup, list[str], Floats, Floats, list[str]]:
    """Return a group whose predictor stays: hardly a row is inside its range, and only the fixed offset may move."""
    how, moved, left = list[str](), np.zeros(of_offset.shape[1]), of_offset.copy()
    for k, error in enumerate(of_offset.T):
        without = _left_on_blocks(_zero_of(block), error, block)
        moved_it = pays(error, without, block)
        how.append(ZERO_AND_SCALE if moved_it else UNCHANGED)
        left[:, k] = without if moved_it else error
        moved[k] = error.mean() if moved_it else 0.0
    return group, how, left, moved, notes


def pays(before: Floats, left: Floats, block: Integers) -> bool:
    """Return whether a change leaves less on blocks that it did not see: by one standard error, and by 1 %, (N,)."""
    both = np.stack([before, left])
    rmse = np.array([np.sqrt(np.mean(np.square(both[:, block == k]), axis=1)) for k in np.unique(block)])  # (K, 2)
    if len(rmse) < 2:
        return False
    gain = rmse[:, 0] - rmse[:, 1]
    least = gain.std(ddof=1) / np.sqrt(len(gain)) + _RESOLUTION_SI + _CLOSE_SHARE * rmse[:, 1].mean()
    return bool(gain.mean() > least)


def _widened(old: ValidRange, watched: Floats) -> ValidRange:
    """Return a valid range that also holds new rows (N, F)."""
    projection = (watched - old.mean) @ old.axes
    return replace(
        old,
        lower=np.minimum(old.lower, watched.min(axis=0)),
        upper=np.maximum(old.upper, watched.max(axis=0)),
        # a projection rounds otherwise in the loop
        axis_lower=np.minimum(old.axis_lower, projection.min(axis=0) - MIN_RANGE),
        axis_upper=np.maximum(old.axis_upper, projection.max(axis=0) + MIN_RANGE),
    )


# columns (N, c), and what returns slopes (c,) and a zero by which some rows of them predict residuals
_Design = tuple[Floats, Callable[[Floats, Floats], tuple[Floats, float]]]


def _ridge(columns: Floats, y: Floats, ridge: float = 0.0) -> tuple[Floats, float]:
    """Regress y (N,) on standardised columns (N, c), held by `ridge`, with a zero that is not held."""
    mean, scale = standardisation(columns)
    Z = (columns - mean) / scale
    slopes = np.linalg.solve(Z.T @ Z + ridge * len(Z) * np.eye(Z.shape[1]), Z.T @ (y - y.mean())) / scale
    return slopes, float(y.mean() - mean @ slopes)


def _zero_of(rows: NDArray[Any]) -> _Design:
    return np.zeros((len(rows), 0)), _ridge


def _held(
    model: CalibrationModel,
    joint: int,
    correction: Floats,
    q: Floats,
    place: int | None,
    trained: tuple[float, float] | None,
    sweeps: int,
) -> _Design:
    """Return the design of a joint's zero, and slopes of its correction and position (N,), by `regress_held`."""
    offset = model.offset[joint]
    largest = 0.5 * (model.largest[joint] - abs(offset))
    moved = max(np.sqrt(np.square(correction - offset).mean()), largest if np.isfinite(largest) else 0.0)
    centre, box = (0.0, 0.0) if trained is None else trained
    claimed = 0.0
    if model.intervals is not None:
        claimed = model.intervals.inside[joint] / NormalDist().inv_cdf(0.5 + 0.5 * model.intervals.level)
    # a slope of the correction is one of the position too, where positions are what the model gives
    taken = 2 if place is not None else 0 if model.target == "position" else 1
    trained_on = np.array([[offset, centre], [moved, box / np.sqrt(12.0)]])[:, :taken]
    shown = partial(regress_held, trained=trained_on, rows=len(q), looks=0.5 * (sweeps + 1), claimed=float(claimed))
    return np.column_stack([correction, q])[:, :taken], shown


def regress_held(
    columns: Floats,
    y: Floats,
    *,
    trained: Floats,  # (2, c) middle of the trained range, where the zero is told, and its spread
    rows: int,  # of which these are some
    looks: float,  # that they are worth
    claimed: float,  # [rad|m] standard deviation of the error that the model claims; 0 when it claims none
) -> tuple[Floats, float]:
    """Return slopes (c,) and a zero as far as minutes show them: a Bayesian regression, see the top of the file."""
    slopes, zero = _ridge(columns, y, _SCALE_RIDGE)
    noise = max(float(np.square(y - zero - columns @ slopes).mean()), claimed**2, _RESOLUTION_SI**2)
    drift = max(noise, float(np.square(y).mean()))
    middle, unit = trained[0], np.where(trained[1] > 0.0, trained[1], 1.0)
    A = np.column_stack([np.ones(len(y)), (columns - middle) / unit])
    held = noise / drift * rows / looks * np.eye(A.shape[1])
    found = np.linalg.solve(A.T @ A + held, A.T @ y)
    slopes = found[1:] / unit
    return slopes, float(found[0] - middle @ slopes)


def _left_on_blocks(design: _Design, residual: Floats, block: Integers) -> Floats:
    """Return what a regression on a design leaves of residuals (N,) on blocks that it did not see."""
    (columns, regression), left = design, residual.copy()
    names = np.unique(block)
    for k in names if len(names) > 1 else ():
        new = block == k
        slopes, zero = regression(columns[~new], residual[~new])
        left[new] -= columns[new] @ slopes + zero
    return left
