"""Errors of every kind of model on fifths of a recording that it was not fitted to, and on other recordings.

What rules for choices and intervals can be told by: each fifth of what `auto` would see is left out in turn, as if it
were the test, and models fitted without it and without each of the others stand for the cross-validation.
"""

from collections.abc import Iterable, Mapping
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data, error_limits
from catenary.calibration.evaluate import CrossValidation, Spread, evaluate
from catenary.calibration.fit_options import FOLDS, FitOptions
from catenary.calibration.fit_rows import Inputs, choose_inputs, fit
from catenary.units import DISPLAY
from papers.calibration.dvrk import HELD_OUT, limit_of, log_of

Left = tuple[int, ...]  # fifths that a model did not see
ALL_LEFT: tuple[Left, ...] = (
    *((k,) for k in range(FOLDS)),
    *combinations(range(FOLDS), 2),
    *(tuple(range(k, FOLDS)) for k in range(1, FOLDS - 1)),  # fitted to what comes before alone
)


class Fifths:
    """Errors on the rows of a recording that models are fitted to, by kind and by what they did not see."""

    def __init__(self, data: CalibrationData, block: NDArray[np.int64]) -> None:
        """Begin without errors, of rows whose fifth is `block` (N,)."""
        self.data, self.block = data, block
        self.errors: dict[tuple[str, Left], Floats] = {}

    def unseen(self, kind: str, fifths: Iterable[int], without: Left = (), *, before: bool = False) -> Floats:
        """Return errors on fifths, each by a model that saw neither it nor `without`, (rows of the fifths, n).

        Args:
            kind: Of the model.
            fifths: Which, in order.
            without: Fifths that no model saw.
            before: Models saw only what comes before.
        """
        parts = []
        for k in fifths:
            left = tuple(range(k, FOLDS)) if before else tuple(sorted({k, *without}))
            parts.append(self.errors[kind, left][self.block == k])
        return np.concatenate(parts)

    def validation(self, kind: str, fifths: list[int], without: Left = (), *, before: bool = False) -> CrossValidation:
        """Return these errors as the cross-validation that a choice is made by."""
        errors = self.unseen(kind, fifths, without, before=before)
        block = np.concatenate([self.block[self.block == k] for k in fifths])
        recording = np.concatenate([self.data.recording[self.block == k] for k in fifths])
        return as_validation(self.data, errors, block, recording)


def as_validation(
    data: CalibrationData, errors: Floats, block: NDArray[np.int64], recording: NDArray[np.int64]
) -> CrossValidation:
    """Return errors (N, n) on blocks (N,) of rows as a cross-validation."""
    spreads = []
    for j, (name, unit) in enumerate(zip(data.joint_names, data.joint_units, strict=True)):
        rmse = [DISPLAY[unit][1] * float(np.sqrt(np.square(errors[block == k, j]).mean())) for k in np.unique(block)]
        spreads.append(
            Spread(name, DISPLAY[unit][0], len(rmse), float(np.mean(rmse)), float(np.std(rmse, ddof=1)), 0.0, 0.0)
        )
    return CrossValidation(tuple(spreads), errors, errors, np.ones(errors.shape, dtype=np.bool_), recording)


def rows_of(recording: str, options: FitOptions, data: Path, held_out: float) -> tuple[Inputs, CalibrationData]:
    """Return inputs and usable rows of a recording, those of its last part left out."""
    log = log_of(recording, data)
    inputs = choose_inputs([log], options, held_out=held_out)
    rows = calibration_data([log], inputs.features, max_error=error_limits(limit_of(recording), log))
    return inputs, rows.split_by_time(held_out)[0] if held_out else rows


def fifths_of(recording: str, kinds: Mapping[str, FitOptions], data: Path) -> Fifths:
    """Fit every kind to all fifths but one, but two, and to those before each, of the first part of a recording."""
    found: Fifths | None = None
    for name, options in kinds.items():
        inputs, rows = rows_of(recording, options, data, HELD_OUT)
        found = found if found is not None else Fifths(rows, rows.blocks(FOLDS))
        for left in ALL_LEFT:
            model = fit(rows.rows(~np.isin(found.block, left)), inputs, options)
            found.errors[name, left] = evaluate(model, rows).after_model
    if found is None:
        raise AssertionError("an offset can be fitted to any recording")
    return found
