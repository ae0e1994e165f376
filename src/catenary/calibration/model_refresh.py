"""A fitted model brought up to date by minutes of a new day: zero, scale and friction as one Bayesian mean.

What a day changes is, of each joint, a zero and slopes of its correction and of its position; and of joints that
friction couples the level of each element's friction, in its logarithm, whose effect is the derivative of all
corrections by it. All are the mean of one linear regression [Bishop, Pattern Recognition and Machine Learning, 2006,
section 3.3], recomputed where the level lies. Before the day a drift may be as large as what its rows show, of the zero
as of each slope over the trained range, and friction has a spread of _LEVEL_SPREAD.

Neighbouring rows are hardly independent, and minutes tell nothing of where they did not go: rows count as a look for
each two sweeps of half the trained range, before which a zero cannot be separated from the side of the slack on which
the joint lies, with an error as large as the model's intervals claim or the regression leaves. A joint keeps its model
where blocks of time that are left out in turn show no gain, by one standard error of the paired differences (Breiman et
al., Classification and Regression Trees, 1984, 3.4.3); friction its level, by two.
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
from catenary.calibration.recordings import Recordings
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.errors import InputError
from catenary.units import DISPLAY

UNCHANGED, ZERO_AND_SCALE, FRICTION_LEVEL = "nothing", "zero and scale", "friction level"
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
    mean = day.mean(block, seen)
    how = [""] * len(names)
    if recordings is not None and model.features.friction is not None:
        coupled = [name.removeprefix("q:") for name in model.features.friction.positions]
        other = _at_its_level(day, recordings, block, seen)
        shown = other.mean(block, seen)
        if _pays_level(mean.left, shown.left, block, [names.index(name) for name in coupled]):
            day, mean = other, shown
            how = [FRICTION_LEVEL if name in coupled else "" for name in names]
            factors = zip(coupled, np.exp(day.level).tolist(), strict=False)
            notes.append(f"friction of this day over the model's: {', '.join(f'{n} {f:.2f}' for n, f in factors)}")
    left, moved, adjustment = day.residual.copy(), np.zeros(len(names)), model.adjusted.copy()
    for j, name in enumerate(names):
        inside = day.inside[:, j]
        if not inside.all():
            notes.append(f"{name}: {1.0 - inside.mean():.1%} of the new rows lie outside the valid range")
        rows = day.used(j)
        if _pays(day.residual[rows, j], mean.left[rows, j], block[rows]):
            how[j] = ", ".join(filter(None, (how[j], ZERO_AND_SCALE)))
            if seen[j][1] < MIN_SWEEPS:
                notes.append(_too_local(name, seen[j]))
            slopes, zero = mean.slopes[j], mean.zeros[j]
            moved[j] = (zero + day.correction[rows, j] * slopes[0] + data.q_nominal[rows, j] * slopes[1]).mean()
            left[:, j] = np.where(rows, mean.left[:, j], left[:, j] - moved[j])
            adjustment[:, j] = adjustment[:, j] * (1.0 + slopes[0]) + [0.0, slopes[1], zero]
    refreshed = replace(
        day.model, offset=model.offset + moved, adjustment=adjustment, largest=np.full(len(names), ANY_SIZE)
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
    slopes: Floats  # (n, 2) of corrections and of positions
    zeros: Floats  # (n,) [rad|m]
    left: Floats  # (N, n) errors of means without each row's block [rad|m]


class _Day:
    def __init__(self, model: CalibrationModel, data: CalibrationData, level: Floats, by_level: Floats) -> None:
        self.model, self.data = model, data
        self.level, self.by_level = level, by_level  # (m,) in logarithms; (N, n, m) slopes of corrections
        self.correction, self.inside, _ = model.correct(data.X, data.q_nominal)
        self.residual = data.error - self.correction

    def used(self, joint: int) -> Flags:
        """Return the rows that tell of a joint's model, (N,): all where hardly one lies in its valid range."""
        inside = self.inside[:, joint]
        return inside if inside.sum() >= _MIN_ROWS else np.ones_like(inside)

    def mean(self, block: Integers, seen: list[tuple[float, int]]) -> _Mean:
        """Return the mean of the level and of all joints' zeros and slopes, from rows in blocks (N,)."""
        n, m = len(seen), len(self.level)
        sums, moments = np.zeros((_BLOCKS, m + 3 * n, m + 3 * n)), np.zeros((_BLOCKS, m + 3 * n))
        spread, designs = np.full(m + 3 * n, _LEVEL_SPREAD**2), []
        for j in range(n):
            rows, (middle, unit) = self.used(j), self._trained(j)
            columns = (np.column_stack([self.correction[:, j], self.data.q_nominal[:, j]]) - middle) / unit
            columns *= self.inside[:, j].sum() >= _MIN_ROWS  # of the fixed offset the zero alone
            A, y = np.column_stack([self.by_level[:, j], np.ones(len(rows)), columns]), self.residual[:, j]
            own = np.append(np.arange(m), m + 3 * j + np.arange(3))
            noise, spread[own[m:]] = self._noise(j, A[rows], y[rows])
            weight = 0.5 * (seen[j][1] + 1) / (noise * rows.sum())
            designs.append((A, own, middle, unit))
            for k in range(_BLOCKS):
                part = rows & (block == k)
                sums[k][np.ix_(own, own)] += weight * A[part].T @ A[part]
                moments[k][own] += weight * A[part].T @ y[part]
        prior = np.append(-self.level, np.zeros(3 * n)) / spread
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
        of_joints = mean[m:].reshape(n, 3)
        slopes = of_joints[:, 1:] / np.array([unit for *_, unit in designs])
        zeros = of_joints[:, 0] - np.sum(slopes * [middle for _, _, middle, _ in designs], axis=1)
        return _Mean(mean[:m], slopes, zeros, left)

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
            level = np.clip(level + day.mean(block, seen).level, -_LARGEST_LEVEL, _LARGEST_LEVEL)
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


def _too_local(name: str, seen: tuple[float, int]) -> str:
    return (
        f"{name}: these minutes are too local for all of a change of {ZERO_AND_SCALE}: they show {seen[0]:.0%} of the "
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


def _pays_level(before: Floats, left: Floats, block: Integers, joints: list[int]) -> bool:
    """Return True if another level lowers coupled joints' log errors by two standard errors."""
    gain = np.log(_rmse_on(block, before[:, joints]) / _rmse_on(block, left[:, joints])).mean(axis=1)
    return bool(gain.mean() > max(2.0 * gain.std(ddof=1) / np.sqrt(len(gain)), _CLOSE_SHARE))
