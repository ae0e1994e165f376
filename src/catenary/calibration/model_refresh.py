"""A fitted model brought up to date by minutes of a new day: zero, scale and friction as one Bayesian mean.

What a day changes is, of each joint, a zero and slopes of its correction and of its position, or the size of what its
play and friction states add, or both; and of joints that friction couples the level of each element's friction, in its
logarithm, whose effect is the derivative of all corrections by it. All are the mean of one linear regression [Bishop,
Pattern Recognition and Machine Learning, 2006, section 3.3], recomputed where the level lies. Before the day a drift
may be as large as what its rows show, of the zero as of each slope over the trained range, and friction has a spread of
_LEVEL_SPREAD.

Neighbouring rows are hardly independent, and minutes tell nothing of where they did not go: rows count as a look for
each two sweeps of half the trained range, before which a zero cannot be separated from the side of the slack on which
the joint lies, with an error as large as the model's intervals claim or the regression leaves. A joint keeps its model
where blocks of time that are left out in turn show no gain, by one standard error of the paired differences (Breiman et
al., Classification and Regression Trees, 1984, 3.4.3). Else it takes friction alone, or with a zero, or zero and scale,
where these leave hardly more than all do. Joints that friction couples keep its level where they gain less than two.
"""

from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.conformal import estimate_intervals, rmse_of_other_minutes
from catenary.calibration.dataset import CalibrationData, usable_rows
from catenary.calibration.evaluate import CrossValidation, rms
from catenary.calibration.fit_rows import largest_shown
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.calibration.predictors import Expansion
from catenary.calibration.recordings import Recordings
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.errors import InputError
from catenary.units import DISPLAY

UNCHANGED, ZERO_AND_SCALE, FRICTION = "nothing", "zero and scale", "friction"
_ZERO = "zero"
# what may change of a joint, which compete, the simplest first: columns of its memory, a zero, its correction and
# its position
_COLUMNS = {
    FRICTION: [0], _ZERO: [1], f"{FRICTION} and {_ZERO}": [0, 1], ZERO_AND_SCALE: [1, 2, 3],
    f"{FRICTION}, {ZERO_AND_SCALE}": [0, 1, 2, 3],
}  # fmt: skip
_NEAR_RATIO = 1.05  # of errors: drawn arms of even seeds, whose friction grew by a half, have up to 1.04
_BLOCKS = 8  # of time, on which changes are judged
_MIN_ROWS = 40  # five a block
_RESOLUTION_SI = 1e-9  # [rad|m] differences that no encoder shows
_SWEEP_SHARE = 0.5  # of the trained range, from one side to the other, that makes a sweep
MIN_SWEEPS = 10  # of a joint; fewer are reported
_CLOSE_SHARE = 0.01  # of the error: what is better by less is not worth a change
_LEVEL_SPREAD = 0.4  # of a day's friction, in its logarithm, about the model's
_LEVEL_STEP, _LARGEST_LEVEL, _LOOKS_AT_LEVEL = 0.25, 1.5, 5  # of its derivative; of logarithms; iterations


@dataclass(frozen=True)
class JointChange:
    """Result of a refresh for one joint, as on the card, in deg or mm."""

    name: str
    unit: str  # "deg" or "mm"
    change: str  # UNCHANGED, or one of _COLUMNS
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


def refresh_model(model: CalibrationModel, data: CalibrationData, recordings: Recordings | None = None) -> Refreshed:
    """Bring a model up to date with rows of a new day; with the recordings that they are of, its level of friction too.

    Rows outside the valid range, where the fixed offset is used, change nothing but, where there are few others, that.
    Intervals are the wider of the old ones and those of errors left on blocks, or none.
    """
    data.require(model, model.features)
    if len(data) < _MIN_ROWS:
        raise InputError(f"data: {len(data)} usable rows of the new day, expected at least {_MIN_ROWS}")
    block = np.arange(len(data)) * _BLOCKS // len(data)
    old, seen = model.correction(data.X, data.q_nominal), _swept(model, data)
    nothing = np.zeros((*data.error.shape, 0))
    day, notes, names = _Day(model, data, np.zeros(0), nothing), list[str](), list(model.joint_names)
    means = {change: day.mean(block, seen, change) for change in _COLUMNS}
    how, factors, sizes = [""] * len(names), np.ones(len(names)), dict[str, float]()
    if recordings is not None and model.features.friction is not None:
        coupled = [name.removeprefix("q:") for name in model.features.friction.positions]
        other = _at_its_level(day, recordings, block, seen)
        shown = {change: other.mean(block, seen, change) for change in _COLUMNS}
        before, after = (by_change[ZERO_AND_SCALE].left for by_change in (means, shown))
        if _pays_level(before, after, block, [names.index(name) for name in coupled]):
            day, means, how = other, shown, [FRICTION if name in coupled else "" for name in names]
            sizes = dict(zip(coupled, np.exp(day.level).tolist(), strict=False))
    left, moved, adjustment = day.residual.copy(), np.zeros(len(names)), model.adjusted.copy()
    for j, name in enumerate(names):
        inside = day.inside[:, j]
        if not inside.all():
            notes.append(f"{name}: {1.0 - inside.mean():.1%} of the new rows lie outside the valid range")
        rows = day.used(j)
        left_by = {kind: mean.left[rows, j] for kind, mean in means.items()}
        shown_kind = ZERO_AND_SCALE if how[j] else _shown_change(left_by)
        if _pays(day.residual[rows, j], left_by[shown_kind], block[rows]):
            mean, how[j] = means[shown_kind], ", ".join(filter(None, (how[j], shown_kind)))
            if seen[j][1] < MIN_SWEEPS:
                notes.append(_too_local(name, seen[j], shown_kind))
            slopes, zero = mean.slopes[j], mean.zeros[j]
            columns = np.column_stack([day.memory[:, j], day.correction[:, j], data.q_nominal[:, j]])
            moved[j] = (zero + columns[rows] @ slopes).mean()
            left[:, j] = np.where(rows, mean.left[:, j], left[:, j] - moved[j])
            adjustment[:, j] = adjustment[:, j] * (1.0 + slopes[1]) + [0.0, slopes[2], zero]
            factors[j] = 1.0 + slopes[0] / (1.0 + slopes[1])
            sizes |= {name: float(factors[j])} if FRICTION in shown_kind else {}
    if sizes:
        notes.append(f"friction of this day over the model's: {', '.join(f'{n} {f:.2f}' for n, f in sizes.items())}")
    refreshed = replace(
        _with_friction(day.model, factors),
        offset=model.offset + moved,
        adjustment=adjustment,
        largest=np.full(len(names), ANY_SIZE),
    )
    change = refreshed.correction(day.data.X, data.q_nominal) - old
    # where the new rows did not go, corrections moved as far as on them
    largest = np.maximum(model.largest + np.abs(change).max(axis=0), largest_shown(refreshed, day.data))
    refreshed = replace(refreshed, largest=largest)
    if model.intervals is not None:
        inside = refreshed.correct(day.data.X, data.q_nominal)[1]
        errors = CrossValidation((), data.error - refreshed.offset, left, inside, data.recording, block)
        refreshed = replace(refreshed, intervals=_wider(model.intervals, errors))
        if refreshed.intervals is None:
            notes.append(f"no intervals any more: {len(data)} new rows are too few to say whether they hold")
    before = data.error - old
    scale, promise = np.array([DISPLAY[unit][1] for unit in model.joint_units]), rmse_of_other_minutes(left, block)
    of_errors = (np.sqrt(np.mean(np.square(errors), axis=0)) for errors in (before, left))
    numbers = (scale * np.array([change.mean(axis=0), *of_errors, *promise])).T.tolist()
    changes = tuple(
        JointChange(name, DISPLAY[unit][0], how[j] or UNCHANGED, *numbers[j])
        for j, (name, unit) in enumerate(zip(names, model.joint_units, strict=True))
    )
    return Refreshed(refreshed, changes, tuple(notes), before, left)


def _wider(old: Intervals, errors: CrossValidation) -> Intervals | None:
    """Return the wider of two: minutes show where intervals are too narrow, not that they are too wide."""
    new = estimate_intervals(errors, level=old.level)
    if new is None:
        return None
    inside = np.maximum(old.inside, new.inside)
    return Intervals(old.level, inside, np.maximum(inside, np.maximum(old.outside, new.outside)))


class _Mean(NamedTuple):
    level: Floats  # (m,) change of the logarithm of each element's friction
    slopes: Floats  # (n, 3) of what memory adds to corrections, of corrections, and of positions
    zeros: Floats  # (n,) [rad|m]
    left: Floats  # (N, n) errors of means without each row's block [rad|m]


class _Day:
    def __init__(self, model: CalibrationModel, data: CalibrationData, level: Floats, by_level: Floats) -> None:
        self.model, self.data = model, data
        self.level, self.by_level = level, by_level  # (m,) in logarithms; (N, n, m) slopes of corrections
        self.correction, self.inside, _ = model.correct(data.X, data.q_nominal)
        self.residual = data.error - self.correction
        self.memory = np.zeros_like(self.residual)  # what play and friction states add to corrections, (N, n)
        for group in model.groups:
            if isinstance(predictor := group.predictor, Expansion):
                kept, joints = predictor.terms.taking(model.features.bounded[group.columns]), list(group.joints)
                terms = predictor.terms.of(data.X[:, group.columns])[:, kept]
                self.memory[:, joints] = terms @ predictor.weights[kept] * model.adjusted[0, joints]
        self.memory *= self.inside

    def used(self, joint: int) -> Flags:
        """Return the rows that tell of a joint's model, (N,): all where hardly one lies in its valid range."""
        inside = self.inside[:, joint]
        return inside if inside.sum() >= _MIN_ROWS else np.ones_like(inside)

    def mean(self, block: Integers, seen: list[tuple[float, int]], change: str) -> _Mean:
        """Return the mean of the level and of what a change has of all joints, from rows in blocks (N,)."""
        n, m, taken = len(seen), len(self.level), _COLUMNS[change]
        size, is_drift = m + len(taken) * n, np.array(taken) > 0
        sums, moments = np.zeros((_BLOCKS, size, size)), np.zeros((_BLOCKS, size))
        spread, designs = np.full(size, _LEVEL_SPREAD**2), []
        for j in range(n):
            rows, (middle, unit) = self.used(j), self._trained(j)
            columns = (np.column_stack([self.correction[:, j], self.data.q_nominal[:, j]]) - middle) / unit
            columns *= self.inside[:, j].sum() >= _MIN_ROWS  # of the fixed offset the zero alone
            own_columns = np.column_stack([self.memory[:, j], np.ones(len(rows)), columns])[:, taken]
            A, y = np.column_stack([self.by_level[:, j], own_columns]), self.residual[:, j]
            own = np.append(np.arange(m), m + len(taken) * j + np.arange(len(taken)))
            noise, spread[own[m:][is_drift]] = self._noise(j, A[rows], y[rows])
            weight = 0.5 * (seen[j][1] + 1) / (noise * rows.sum())
            designs.append((A, own, middle, unit))
            for k in range(_BLOCKS):
                part = rows & (block == k)
                sums[k][np.ix_(own, own)] += weight * A[part].T @ A[part]
                moments[k][own] += weight * A[part].T @ y[part]
        prior = np.append(-self.level, np.zeros(size - m)) / spread
        total, moment, left = (
            sums.sum(axis=0) + np.diag(1.0 / spread),
            moments.sum(axis=0) + prior,
            self.residual.copy(),
        )
        for k in range(_BLOCKS):
            mean = np.linalg.solve(total - sums[k], moment - moments[k])
            for j, (A, own, _, _) in enumerate(designs):
                left[block == k, j] -= A[block == k] @ mean[own]
        mean = np.linalg.solve(total, moment)
        of_joints = np.zeros((n, 4))
        of_joints[:, taken] = mean[m:].reshape(n, len(taken))
        slopes = of_joints[:, 2:] / np.array([unit for *_, unit in designs])
        zeros = of_joints[:, 1] - np.sum(slopes * [middle for _, _, middle, _ in designs], axis=1)
        return _Mean(mean[:m], np.column_stack([of_joints[:, 0], slopes]), zeros, left)

    def _trained(self, joint: int) -> tuple[Floats, Floats]:
        """Return middle and spread of a joint's correction and position in training, (2,) each."""
        model, rows = self.model, self.used(joint)
        offset, centre, box = model.offset[joint], *trained_range(model, joint)
        largest = 0.5 * (model.largest[joint] - abs(offset))
        moved = max(rms(self.correction[rows, joint] - offset), largest if largest < ANY_SIZE / 4.0 else 0.0)
        unit = np.array([moved, box / np.sqrt(12.0)])
        return np.array([offset, centre]), np.where(unit > 0.0, unit, 1.0)

    def _noise(self, joint: int, A: Floats, y: Floats) -> tuple[float, float]:
        """Return the variances of a look's error and of a drift: as the model claims, and as rows show."""
        claimed, intervals = 0.0, self.model.intervals
        if intervals is not None:
            claimed = intervals.inside[joint] / NormalDist().inv_cdf(0.5 + 0.5 * intervals.level)
        left = y - A @ np.linalg.lstsq(A, y, rcond=1e-6)[0]
        noise = max(float(np.square(left).mean()), claimed**2, _RESOLUTION_SI**2)
        return noise, max(noise, float(np.square(y).mean()))


def _at_its_level(day: _Day, recordings: Recordings, block: Integers, seen: list[tuple[float, int]]) -> _Day:
    """Return a day with the model at the level of friction that its recordings show (Gauss-Newton)."""
    friction = day.model.features.friction
    assert friction is not None  # for the type checker
    elements = np.eye(len(friction.directions))
    level = np.zeros(len(elements))

    def at(level: Floats) -> tuple[CalibrationModel, CalibrationData]:
        thresholds = tuple(map(tuple, (np.array(friction.thresholds) * np.exp(level)).tolist()))
        features = replace(day.model.features, friction=replace(friction, thresholds=thresholds))
        return replace(day.model, features=features), usable_rows(recordings, features)

    def correction(level: Floats) -> Floats:
        model, data = at(level)
        return model.correction(data.X, data.q_nominal)

    for look in range(_LOOKS_AT_LEVEL):
        ends = [[correction(level + sign * _LEVEL_STEP * e) for sign in (1, -1)] for e in elements]
        by_level = np.stack([(high - low) / (2.0 * _LEVEL_STEP) for high, low in ends], axis=-1)
        day = _Day(*at(level), level, by_level)
        if look + 1 < _LOOKS_AT_LEVEL:
            level = np.clip(level + day.mean(block, seen, ZERO_AND_SCALE).level, -_LARGEST_LEVEL, _LARGEST_LEVEL)
    return day


def trained_range(model: CalibrationModel, joint: int) -> tuple[float, float]:
    """Return mean and range of a joint's positions in training; zeros where the model asks nothing of them."""
    name, group = f"q:{model.joint_names[joint]}", next(other for other in model.groups if joint in other.joints)
    watched, known = [model.features.names[c] for c in group.watched], group.valid_range
    if name not in watched:
        return 0.0, 0.0
    place = watched.index(name)
    return float(known.mean[place]), float(known.upper[place] - known.lower[place]) * known.seen


def _swept(model: CalibrationModel, data: CalibrationData) -> list[tuple[float, int]]:
    """Return the share of each joint's trained range in new rows, and the number of sweeps over half of it."""
    swept = []
    for joint, q in enumerate(data.q_nominal.T):
        box = trained_range(model, joint)[1]
        sweeps, low, high, up = 0, q[0], q[0], None
        for value in q.tolist() if box > 0.0 else ():
            if up is not True and value - low >= _SWEEP_SHARE * box:
                sweeps, up, high = sweeps + 1, True, value
            elif up is not False and high - value >= _SWEEP_SHARE * box:
                sweeps, up, low = sweeps + 1, False, value
            low, high = min(low, value), max(high, value)
        # where nothing is known of its training, each row is a sweep
        swept.append((float(np.ptp(q)) / box, sweeps) if box > 0.0 else (1.0, len(q)))
    return swept


def _too_local(name: str, seen: tuple[float, int], change: str) -> str:
    return (
        f"{name}: these minutes are too local for all of a change of {change}: they show {seen[0]:.0%} of the "
        f"trained range in {seen[1]} sweeps, expected {MIN_SWEEPS} sweeps; drive `catenary excite --refresh`"
    )


def _rmse_on(block: Integers, errors: Floats) -> Floats:  # (K, m) of errors (N, m) on each block (N,)
    return np.array([np.sqrt(np.mean(np.square(errors[block == k]), axis=0)) for k in np.unique(block)])


def _pays(before: Floats, left: Floats, block: Integers) -> bool:
    """Return True if a change lowers errors on held-out blocks by one standard error and by 1 %, (N,)."""
    rmse = _rmse_on(block, np.column_stack([before, left]))
    if len(rmse) < 2:
        return False
    gain = rmse[:, 0] - rmse[:, 1]
    least = gain.std(ddof=1) / np.sqrt(len(gain)) + _RESOLUTION_SI + _CLOSE_SHARE * rmse[:, 1].mean()
    return bool(gain.mean() > least)


def _shown_change(left: dict[str, Floats]) -> str:
    """Return the simplest change whose errors (N,) on held-out blocks are nearly as small as any's.

    Where a correction is mostly memory, its scale explains a day's friction as well as friction does.
    """
    errors = {change: rms(values) for change, values in left.items()}
    close = _NEAR_RATIO * min(errors.values()) + _RESOLUTION_SI
    shown = next(change for change in _COLUMNS if errors[change] <= close)
    return ZERO_AND_SCALE if shown == _ZERO else shown


def _with_friction(model: CalibrationModel, factors: Floats) -> CalibrationModel:
    """Return a model in which what play and friction states add of joints is larger by factors (n,)."""
    groups = []
    for group in model.groups:
        own = factors[list(group.joints)]
        if isinstance(predictor := group.predictor, Expansion) and (own != 1.0).any():
            kept = predictor.terms.taking(model.features.bounded[group.columns])
            weights = np.where(kept[:, None], predictor.weights * own, predictor.weights)
            group = replace(group, predictor=replace(predictor, weights=weights))
        groups.append(group)
    return replace(model, groups=tuple(groups))


def _pays_level(before: Floats, left: Floats, block: Integers, joints: list[int]) -> bool:
    """Return True if another level lowers coupled joints' log errors by two standard errors."""
    gain = np.log(_rmse_on(block, before[:, joints]) / _rmse_on(block, left[:, joints])).mean(axis=1)
    return bool(gain.mean() > max(2.0 * gain.std(ddof=1) / np.sqrt(len(gain)), _CLOSE_SHARE))
