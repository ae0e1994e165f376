"""Fit a calibration model to recordings; evaluate one on others."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from catenary.calibration.card_schema import check_card
from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.dataset import calibration_data, data_notes, error_limits
from catenary.calibration.evaluate import MUCH_OUTSIDE, WORSE, Evaluation, evaluate
from catenary.calibration.files import load_model
from catenary.calibration.fit import FitOptions
from catenary.calibration.fitting import FitResult, FitRun, fit_logs
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.progress import Progress, silent
from catenary.calibration.upkeep.judged import judge_recordings, trained_limits
from catenary.recording.logs import Reading, read_logs
from catenary.workflows.model_recordings import recordings_for


def fit_calibration(
    paths: Sequence[Path],
    options: FitOptions,
    run: FitRun | None = None,
    *,
    reading: Reading | None = None,
    progress: Progress = silent,
) -> FitResult:
    """Fit a calibration model to files of recordings; see `fit_logs`.

    Raises:
        FileFormatError: A recording is missing, damaged, or lacks something.
        InputError: As `fit_logs`.
    """
    return fit_logs(read_logs(paths, reading), options, run, progress=progress)


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
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
    max_error: tuple[float, ...] | None = None,
    window: float | None = None,
) -> EvaluationResult:
    """Evaluate a model on recordings, those of another make read by their mapping.

    Recordings that do not state their joints' names or units are read with the model's.

    Args:
        model_path: The model's file.
        paths: The recordings.
        reading: Mapping of recordings of another make, and what to change of them.
        accept: Findings about them to go on with, by name.
        max_error: Per joint, deg and mm; rows with larger errors are left out.
        window: Length of a time window [s]; a tenth of the data when None.

    Raises:
        DataError: Something is wrong with a recording that `accept` does not name.
        FileFormatError: The model or a recording is missing or damaged.
        InputError: A recording is of other joints, or lacks an input of the model.
    """
    model, card = load_model(model_path)
    logs = recordings_for(model, paths, reading)
    check_card(card, str(model_path))
    max_error, said = trained_limits(card, max_error, as_trained=reading is None or reading.as_trained)
    limits = error_limits(max_error, logs[0])
    data = calibration_data(logs, model.features, max_error=limits)
    trained_on = {source["sha256"] for source in card["data"]}
    seen = tuple(source.name for source in data.sources if source.sha256 in trained_on)
    notes = [*data_notes(logs, data), *said]
    notes += judge_recordings(model, card, logs, accept=accept, max_error=limits)
    notes += [f"{name}: the model was fitted to this recording; its error here is no test" for name in seen]
    found = evaluate(model, data, window=window)
    return EvaluationResult(model, card, found, (*notes, *warnings_of(found)), seen)


def warnings_of(evaluation: Evaluation) -> list[str]:
    """Return in words where a model does harm, or could not be asked; each opens with "warning: "."""
    warnings = []
    for joint in evaluation.joints:
        if joint.rmse > WORSE * joint.offset_rmse:
            warnings.append(
                f"warning: {joint.name}: the model is worse than the fixed offset here, {joint.rmse:.3g} against "
                f"{joint.offset_rmse:.3g} {joint.unit}: do not deploy it on this joint"
            )
        if joint.outside_valid_range > MUCH_OUTSIDE:
            warnings.append(
                f"warning: {joint.name}: {joint.outside_valid_range:.0%} of rows lie outside the model's valid "
                "range, where it gives the fixed offset; train on motion that goes there"
            )
    return warnings


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
        "intervals": interval_summary(evaluation),
        "seen_in_training": list(result.seen_in_training),
        "notes": list(result.notes),
    }


def interval_summary(evaluation: Evaluation) -> dict[str, Any] | None:
    """Return whether a model's intervals hold, as plain data, in deg and mm; None for a model without."""
    if evaluation.level is None:
        return None
    return {
        "coverage_asked": evaluation.level,
        "joints": [
            {
                "name": joint.name,
                "half_width": joint.half_width,
                "coverage": joint.coverage,
                "verdict": verdict,
            }
            for joint, verdict in zip(evaluation.joints, coverage_verdicts(evaluation), strict=True)
        ],
    }
