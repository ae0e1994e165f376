"""Evaluation of a calibration model: joint errors before and after it, on data that it has not seen."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.parallel import Progress, of_each, silent
from catenary.tables import Column, OnScreen, Screen, Table, in_units
from catenary.units import DISPLAY

HARM_RATIO = 1.01  # times the fixed offset's error: less is no harm
_MIN_RECORDINGS = 3  # from which zeros are separable from motion
OUTSIDE_SHARE = 0.1  # share of rows outside a model's valid range that is worth a warning


@dataclass(frozen=True)
class JointErrors:
    """Errors of one joint, in deg or mm, over n rows."""

    name: str
    unit: str  # "deg" or "mm"
    n: int
    raw_rmse: float
    offset_rmse: float  # after the fixed offset of the model's training data
    rmse: float  # after the model
    raw_max: float
    offset_max: float
    max: float
    percent_of_offset: float  # 100 rmse / offset_rmse, as the paper's table I
    outside_valid_range: float  # share of rows
    coverage: float = math.nan  # share of rows whose error the model's interval holds; NaN if it has none
    half_width: float = math.nan  # of the interval, median over the rows


@dataclass(frozen=True)
class Window:
    """Errors of a stretch of time; start and end in s, or in rows where the recording has no time."""

    recording: str
    start: float
    end: float
    n: int
    raw_rmse: tuple[float, ...]  # per joint, in deg or mm
    offset_rmse: tuple[float, ...]
    rmse: tuple[float, ...]


@dataclass(frozen=True, repr=False)
class Evaluation(OnScreen):
    """Errors per joint, per window, and row by row for plots (rad and m)."""

    joints: tuple[JointErrors, ...]
    data: CalibrationData
    raw: Floats  # (N, n) q_encoder - q_nominal
    after_offset: Floats  # (N, n)
    after_model: Floats  # (N, n)
    inside: Flags  # (N, n)
    interval: Floats  # (N, n) half-width about the calibrated position; NaN if the model has none
    level: float | None  # share of errors that the interval is to hold
    window: float | None = None  # length of a time window [s, or rows]; a tenth of the data when None

    @property
    def window_unit(self) -> str:
        """The unit of a window's start and end, "s" or "rows"."""
        return "s" if self.data.has_time else "rows"

    @cached_property
    def windows(self) -> tuple[Window, ...]:
        """Errors over windows of time, recording after recording."""
        scale = np.array([DISPLAY[unit][1] for unit in self.data.joint_units])
        errors = tuple(scale * array for array in (self.raw, self.after_offset, self.after_model))
        return tuple(_windows(self.data, errors, self.window))

    @property
    def held(self) -> Flags:
        """Flags (N, n) of errors within their intervals."""
        return np.asarray(np.abs(self.after_model) <= self.interval)

    @property
    def screen(self) -> Screen:
        """Errors per joint."""
        names = ", ".join(source.name for source in self.data.sources)
        left = ", ".join(f"{joint.name} {percent(joint.percent_of_offset, 0)}" for joint in self.joints)
        title = f"on {names}: {len(self.data):,} rows"
        return Screen(title, [error_table(self)], f"of the fixed offset's RMSE: {left}")

    def __str__(self) -> str:
        return error_table(self).text()


def percent(value: float, digits: int) -> str:
    """Return a percentage as text; a dash for NaN, a percentage of nothing.

    Args:
        value, digits: Percentage, and number of decimals.
    """
    return f"{value:.{digits}f} %" if np.isfinite(value) else "-"


def error_table(
    evaluation: Evaluation, name: str = "model", *, title: str = "RMSE and largest error per joint"
) -> Table:
    """Return RMSE per joint raw, after the fixed offset and after the model, and the share outside its valid range.

    Args:
        name: Heading of the model's column.
    """
    unit = in_units(joint.unit for joint in evaluation.joints)
    columns: list[Column] = [
        ("joint", "name"), "unit", (f"raw RMSE {unit}", "raw_rmse:.3f"),
        (f"fixed offset RMSE {unit}", "offset_rmse:.3f"), (f"{name} RMSE {unit}", "rmse:.3f"),
        ("of fixed offset [%]", lambda joint: percent(joint.percent_of_offset, 1)),
        (f"largest raw {unit}", "raw_max:.2f"), (f"largest {name} {unit}", "max:.2f"),
        ("outside [% of rows]", "outside_valid_range:.1f %"),
    ]  # fmt: skip
    return Table(columns, evaluation.joints, title)


def evaluate(model: CalibrationModel, data: CalibrationData, *, window: float | None = None) -> Evaluation:
    """Evaluate a model on rows of data: the same ones count for the raw, the offset's and the model's error.

    Args:
        data: Rows with its features.
        window: Length of a time window [s], or rows without time; a tenth of the data when None.
    """
    data.require(model, model.features)
    if len(data) == 0:
        raise InputError("data: no row to evaluate on, expected at least one")
    if window is not None and not 0.0 < window < math.inf:
        raise InputError(f"window: expected a positive length, got {window}")
    correction, inside, interval = model.correct(data.X, data.q_nominal, data.leaping)
    corrected = data.error - correction
    errors = (data.error, data.error - model.offset, corrected)
    scale = np.array([DISPLAY[unit][1] for unit in model.joint_units])
    shown = tuple(scale * array for array in errors)
    rmse = np.array([_rmse_per_joint(array) for array in shown])
    largest = np.array([np.abs(array).max(axis=0) for array in shown])
    percent = 100.0 * np.divide(rmse[2], rmse[1], where=rmse[1] > 0.0, out=np.full(len(scale), np.nan))
    coverage = np.where(model.intervals is None, np.nan, np.mean(np.abs(corrected) <= interval, axis=0))
    half_width = scale * np.median(interval, axis=0)
    columns = np.vstack([rmse, largest, percent, np.mean(~inside, axis=0), coverage, half_width]).T.tolist()
    joints = tuple(
        JointErrors(name, DISPLAY[unit][0], len(data), *numbers)
        for name, unit, numbers in zip(model.joint_names, model.joint_units, columns, strict=True)
    )
    level = None if model.intervals is None else model.intervals.level
    return Evaluation(joints, data, *errors, inside, interval, level, window)


def rms(values: Floats) -> float:
    """Return the root of the mean of squares."""
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True)
class Spread:
    """Errors on blocks or recordings left out in turn [deg|mm], and what they let expect (conformal.py), if known."""

    joint: str
    unit: str
    folds: int
    rmse_mean: float
    rmse_sd: float
    offset_rmse_mean: float
    offset_rmse_sd: float
    rmse_low: float | None = None  # the model's RMSE lies between these where training rows lay
    rmse_high: float | None = None
    rmse_margin: float | None = None  # at most, from there to the edge of the valid range
    held_low: float | None = None  # the share of errors that intervals hold lies between these
    held_high: float | None = None


def spread_table(spread: Sequence[Spread], name: str = "model") -> Table:
    """Return mean and standard deviation of the RMSE over blocks of a cross-validation, and the error to expect.

    Args:
        name: Heading of the model's column.
    """
    unit = in_units(s.unit for s in spread)
    columns: list[Column] = [
        "joint", "unit", ("blocks", "folds"),
        (f"fixed offset RMSE {unit}", lambda s: f"{s.offset_rmse_mean:.3f} ± {s.offset_rmse_sd:.3f}"),
        (f"{name} RMSE {unit}", lambda s: f"{s.rmse_mean:.3f} ± {s.rmse_sd:.3f}"),
    ]  # fmt: skip
    if all(s.rmse_low is not None for s in spread):
        columns.append((f"as trained {unit}", lambda s: f"{s.rmse_low:.3f} to {s.rmse_high:.3f}"))
        columns.append((f"in the margin {unit}", lambda s: f"at most {s.rmse_margin:.3f}"))
    if all(s.held_low is not None for s in spread):
        shares = "in intervals [% of rows]"
        columns.append((shares, lambda s: f"{100 * s.held_low:.0f} to {100 * s.held_high:.0f} %"))
    return Table(columns, spread, "RMSE on data that the fit did not see, and on a stretch to come")


@dataclass(frozen=True)
class CrossValidation:
    """Errors on every row of N by models that did not see its block, and their spread over the blocks."""

    spread: tuple[Spread, ...]
    after_offset: Floats  # (N, n) [rad|m]
    after_model: Floats  # (N, n) [rad|m]
    inside: Flags  # (N, n) in the valid range of the model that did not see the row
    recording: Integers  # (N,) of the rows
    block: Integers  # (N,) of time, that was left out
    zeros: Floats | None = None  # (N, n) errors with zeros from other recordings; None if recordings are few

    @property
    def of_others(self) -> Floats:
        """Errors as they are on another recording, (N, n) [rad|m]: with a zero estimated without its blocks."""
        return self.after_model if self.zeros is None else self.after_model + self.zeros

    @property
    def stretch(self) -> Integers:
        """What differs as another stretch does, (N,): recordings where zeros are known, else blocks."""
        return self.block if self.zeros is None else self.recording


def cross_validate(
    data: CalibrationData,
    fit: Callable[[CalibrationData, Progress], CalibrationModel],
    *,
    folds: int,  # at least 2
    progress: Progress = silent,
) -> CrossValidation:
    """Return errors on blocks (`CalibrationData.blocks`), each left out of the fit in turn; rows are never shuffled.

    A block's zero is known from the others of its recording: of several recordings whole ones are left out, too.
    """
    if folds < 2 or folds > len(data):
        raise InputError(f"folds: expected 2 to {len(data)} (the usable rows), got {folds}")
    block = data.blocks(folds)
    present = [k for k in range(folds) if (block == k).any()]
    if len(present) < 2:
        raise InputError(f"folds: {folds} blocks leave no rows to fit to, {len(data)} rows in all")
    after_offset, after_model = np.empty_like(data.error), np.empty_like(data.error)
    inside, several = np.empty(data.error.shape, dtype=bool), len(data.sources) >= _MIN_RECORDINGS
    whole = data.recording * min(folds, len(data.sources)) // len(data.sources)
    left_out = [block == k for k in present] + [whole == k for k in np.unique(whole)] * several

    def left_by(rows: Flags, tell: Progress) -> Evaluation:
        return evaluate(fit(data.rows(~rows), tell), data.rows(rows))

    every = of_each(left_by, left_out, progress=progress)
    lefts = every[: len(present)]
    for rows, left in zip(left_out[: len(present)], lefts, strict=True):
        after_offset[rows], after_model[rows], inside[rows] = left.after_offset, left.after_model, left.inside
    zeros = np.zeros_like(after_model)
    for rows, left in zip(left_out[len(present) :], every[len(present) :], strict=True):
        for number in np.unique(data.recording[rows]):
            own = data.recording == number
            zeros[own] = left.after_model[own[rows]].mean(axis=0) - after_model[own].mean(axis=0)
    results = [left.joints for left in lefts]
    spreads = []
    for joint, *of_folds in zip(results[0], *results, strict=True):
        errors = np.array([(fold.rmse, fold.offset_rmse) for fold in of_folds])
        of_both = np.column_stack([errors.mean(axis=0), errors.std(axis=0, ddof=1)])
        spreads.append(Spread(joint.name, joint.unit, len(results), *of_both.ravel().tolist()))
    return CrossValidation(
        tuple(spreads), after_offset, after_model, inside, data.recording, block, zeros if several else None
    )


def _windows(data: CalibrationData, errors: tuple[Floats, ...], window: float | None) -> list[Window]:
    spans = []
    for number, source in enumerate(data.sources):
        rows = np.flatnonzero(data.recording == number)
        # where a recording's clock went back, another one begins
        parts = np.split(rows, np.flatnonzero(np.diff(data.time[rows]) < 0.0) + 1)
        names = [f"{source.name} ({k + 1})" if len(parts) > 1 else source.name for k in range(len(parts))]
        # n rows take n steps, but n - 1 intervals of time, whose last window holds its end too
        of_rows = 0.0 if data.has_time else 1.0
        spans += [(n, p, float(np.ptp(data.time[p])) + of_rows) for n, p in zip(names, parts, strict=True) if len(p)]
    everything = max(sum(duration for *_, duration in spans), 1e-12)
    windows = []
    for name, rows, duration in spans:
        # about ten windows in all, equally long within a recording
        length = window or duration / max(1, round(10.0 * duration / everything)) or 1.0
        start = float(data.time[rows[0]])
        index = np.floor((data.time[rows] - start) / length).astype(int)
        index = np.minimum(index, max(0, math.ceil(duration / length - 1e-9) - 1))
        for k in np.unique(index):
            part = rows[index == k]
            rmse = (_rmse_per_joint(array[part]) for array in errors)
            windows.append(Window(name, start + k * length, start + (k + 1) * length, len(part), *rmse))
    return windows


def _rmse_per_joint(errors: Floats) -> tuple[float, ...]:
    return tuple(np.sqrt(np.mean(np.square(errors), axis=0)).tolist())
