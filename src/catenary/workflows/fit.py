"""Fit a calibration model to recordings; evaluate one on others."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import read_arrays
from catenary.arrays import Floats
from catenary.calibration.card import model_card
from catenary.calibration.card_schema import check_card
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.evaluate import Evaluation, Spread, cross_validate, evaluate
from catenary.calibration.files import load_model
from catenary.calibration.fit import SMALLEST_DATA, FitOptions, choose_inputs, fit
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.progress import Progress, silent
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.foreign.mapping import RecordingMapping
from catenary.recording.foreign.read import read_recording
from catenary.recording.logs import read_log
from catenary.units import DISPLAY

FOLDS = 5
OUTLIER_SPREADS = 10.0  # robust standard deviations beyond which a measurement is suspected


@dataclass(frozen=True)
class FitRun:
    """Options of a fit that do not belong to the model: how recordings are read and held out."""

    units: tuple[str, ...] | None = None
    joint_names: tuple[str, ...] | None = None
    robot: str | None = None
    max_error: tuple[float, ...] | None = None  # per joint, deg and mm; rows beyond are left out
    held_out: float | None = None  # share at the end of each recording
    folds: int = FOLDS  # of the cross-validation; 0 for none
    mapping: RecordingMapping | None = None  # of recordings of another make

    def __post_init__(self) -> None:
        if self.held_out is not None and not 0.0 < self.held_out < 1.0:
            raise InputError(f"held-out share: expected a number between 0 and 1, got {self.held_out}")
        if self.folds < 0 or self.folds == 1:
            raise InputError(f"folds: expected 2 or more, or 0 for no cross-validation, got {self.folds}")


@dataclass(frozen=True)
class FitResult:
    """A fitted model, its card and its errors on data that it did not see."""

    model: CalibrationModel
    card: Card
    data: CalibrationData  # that it was fitted to
    spread: tuple[Spread, ...]
    held_out: Evaluation | None
    notes: tuple[str, ...]


def fit_calibration(
    paths: Sequence[Path], options: FitOptions, run: FitRun | None = None, *, progress: Progress = silent
) -> FitResult:
    """Fit a calibration model to recordings and say how well it does on data that it did not see.

    The model is fitted to all rows, or to those before the held-out part. Its error is estimated on contiguous
    blocks of time, each predicted by a model fitted to the others, and on the held-out part.

    Raises:
        FileFormatError: A recording is missing, damaged, or lacks something.
        InputError: Recordings of different joints, unusable numbers, options that contradict each other.
    """
    run = run if run is not None else FitRun()
    logs = [read_recording(path, run.mapping, units=run.units, joint_names=run.joint_names) for path in paths]
    if not logs:
        raise InputError("data: expected at least one recording, got none")
    longest = max(len(log) for log in logs)
    if options.history >= longest:
        raise InputError(
            f"history: {options.history} previous commands, but the longest recording has {longest} rows"
        )
    inputs = choose_inputs(logs, options, held_out=run.held_out or 0.0)
    everything = calibration_data(logs, inputs.features, max_error=_limits(run.max_error, logs[0]))
    notes = tuple(_notes(logs, everything))
    data, late = everything, None
    if run.held_out is not None:
        data, late = everything.split_by_time(run.held_out)

    _require_rows(data, run.folds)
    share = run.folds / (run.folds + 1.0)
    spread: tuple[Spread, ...] = ()
    if run.folds:
        spread = cross_validate(
            data,
            lambda rows, tell: fit(rows, inputs, options, progress=tell),
            folds=run.folds,
            progress=lambda done: progress(share * done),
        )
    model = fit(data, inputs, options, progress=lambda done: progress(share + (1.0 - share) * done))
    held_out = None if late is None else evaluate(model, late)
    card = model_card(
        model,
        data,
        options,
        robot=run.robot if run.robot is not None else data.robot,
        command={
            "held_out": run.held_out,
            "folds": run.folds,
            # JSON has no infinity: null is no limit
            "max_error": run.max_error and [e if math.isfinite(e) else None for e in run.max_error],
        },
        spread=spread,
        held_out=held_out,
        notes=notes,
    )
    return FitResult(model, card, data, spread, held_out, notes)


@dataclass(frozen=True)
class EvaluationResult:
    """Errors of a model on recordings."""

    model: CalibrationModel
    card: Card
    evaluation: Evaluation
    notes: tuple[str, ...]
    seen_in_training: tuple[str, ...]  # recordings that the model was fitted to: their errors are no test


def evaluate_calibration(
    model_path: Path,
    paths: Sequence[Path],
    *,
    max_error: tuple[float, ...] | None = None,
    window: float | None = None,
) -> EvaluationResult:
    """Evaluate a model on recordings.

    Recordings that do not state their joints' names or units are read with the model's.

    Raises:
        FileFormatError: The model or a recording is missing or damaged.
        InputError: A recording is of other joints, or lacks an input of the model.
    """
    model, card = load_model(model_path)
    logs = [_read_for(model, path) for path in paths]
    if not logs:
        raise InputError("data: expected at least one recording, got none")
    for log in logs:
        model.require_joints(log)
    data = calibration_data(logs, model.features, max_error=_limits(max_error, logs[0]))
    check_card(card, str(model_path))
    trained_on = {source["sha256"] for source in card["data"]}
    seen = tuple(source.name for source in data.sources if source.sha256 in trained_on)
    notes = _notes(logs, data)
    notes += [f"{name}: the model was fitted to this recording; its error here is no test" for name in seen]
    return EvaluationResult(model, card, evaluate(model, data, window=window), tuple(notes), seen)


def evaluation_summary(result: EvaluationResult) -> dict[str, Any]:
    """Return an evaluation as plain data, in deg and mm."""
    evaluation = result.evaluation
    return {
        "model": {"kind": result.model.kind, "preset": result.model.preset, "target": result.model.target},
        "data": [asdict(source) for source in evaluation.data.sources],
        "simulated": any(source.simulated for source in evaluation.data.sources),
        "joints": [asdict(joint) for joint in evaluation.joints],
        "window_unit": evaluation.window_unit,
        "windows": [asdict(window) for window in evaluation.windows],
        "seen_in_training": list(result.seen_in_training),
        "notes": list(result.notes),
    }


def _read_for(model: CalibrationModel, path: Path) -> MotionLog:
    """Read a recording, taking the model's names and units where a bare command log does not state them.

    Raises:
        InputError: The recording has another number of joints.
    """
    if path.suffix != ".npz":
        return read_log(path)
    content = read_arrays(path)
    commands = content.get("q_des")
    n = len(model.joint_names)
    if commands is not None and commands.ndim == 2 and commands.shape[1] != n:
        raise InputError(
            f"{path}: has {commands.shape[1]} joints; the model is for {n}: {', '.join(model.joint_names)}"
        )
    return read_log(
        path,
        units=None if "units" in content else model.joint_units,
        joint_names=None if "joint_names" in content else model.joint_names,
    )


def _require_rows(data: CalibrationData, folds: int) -> None:
    """Refuse data too few for the smallest fit of a run, before the longest one has run."""
    rows = len(data)
    if rows < SMALLEST_DATA:
        raise InputError(f"data: {rows} usable rows, expected at least {SMALLEST_DATA}")
    smallest = rows - math.ceil(rows / folds) if folds else rows
    if smallest < SMALLEST_DATA:
        raise InputError(
            f"data: {rows} usable rows; with one of {folds} blocks left out {smallest} remain, expected at least "
            f"{SMALLEST_DATA}; folds 0 is no cross-validation"
        )


def _limits(max_error: tuple[float, ...] | None, log: MotionLog) -> Floats | None:
    if max_error is None:
        return None
    if len(max_error) != len(log.joint_names) or not all(limit > 0.0 for limit in max_error):
        raise InputError(
            f"max error: expected {len(log.joint_names)} positive numbers (deg, mm), one per joint, "
            f"got {list(max_error)}"
        )
    return np.array([most / DISPLAY[unit][1] for most, unit in zip(max_error, log.joint_units, strict=True)])


def outliers(errors: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Return how many of N errors (N, n) lie beyond OUTLIER_SPREADS robust standard deviations, and these, (n,)."""
    deviation = np.abs(errors - np.median(errors, axis=0))
    spread: Floats = 1.4826 * np.median(deviation, axis=0)  # the standard deviation, if errors were normal
    return (deviation > OUTLIER_SPREADS * np.maximum(spread, 1e-9)).sum(axis=0), spread


def _notes(logs: Sequence[MotionLog], data: CalibrationData) -> list[str]:
    """Return what readers of recordings noted, what rows were left out, and what looks wrong in the others."""
    notes = [f"{log.name}: {note}" for log in logs for note in log.notes]
    for source in data.sources:
        left_out = {
            "without measurement": source.without_truth,
            f"without {data.features.history} previous commands": source.without_history,
            "beyond the error limit": source.dropped,
        }
        text = ", ".join(f"{count} {why}" for why, count in left_out.items() if count)
        if text:
            notes.append(f"{source.name}: left out {text}, of {source.rows} rows")
        if source.leaps:
            notes.append(f"{source.name}: play states did not follow {source.leaps} leaps of a joint")
    for name, count in zip(data.joint_names, outliers(data.error)[0], strict=True):
        if count:
            notes.append(
                f"{name}: {count} of {len(data)} errors lie beyond {OUTLIER_SPREADS:g} robust standard deviations; "
                "if they are measurement failures, leave them out with --max-error"
            )
    still = [n for n, x in zip(data.joint_names, np.ptp(data.q_nominal, axis=0), strict=True) if x == 0.0]
    if still:
        notes.append(f"{', '.join(still)}: never moved; the model holds only where they stood")
    return notes
