"""A calibration model and files of recordings: fitted, evaluated, held against days, refreshed."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from catenary.archives import read_arrays
from catenary.arrays import Floats
from catenary.bounded_parsers import MAX_JSON_BYTES, json_table, read_bounded
from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.dataset import data_notes, usable_rows
from catenary.calibration.evaluate import HARM_RATIO, OUTSIDE_SHARE, Evaluation, evaluate
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_drift import DRIFT_FACTOR, DriftFound, find_card_drift, find_drift, since_in_words
from catenary.calibration.model_file import load_model
from catenary.calibration.model_maintenance import (
    NewDay,
    judge_recordings,
    mended_as_trained,
    refresh_with,
    trained_limits,
)
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.file_formats import format_of
from catenary.files import sha256_of
from catenary.parallel import Progress, of_each, silent
from catenary.plant import Joints, MotionLog, nameless
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.logs import Reading, on_disk, read_log, read_recording

_MAX_ROWS_IN_MEMORY = 20_000  # rows of a recording, one of several, that lies on disk until its turn comes


def fit_calibration(
    paths: Sequence[Path],
    options: FitOptions,
    run: FitRun | None = None,
    *,
    reading: Reading | None = None,
    progress: Progress = silent,
) -> FitResult:
    """Fit a calibration model to files of recordings; see `fit_logs`. Long ones stay on disk meanwhile.

    Args:
        run: Rows that the fit sees, and its tests; all rows when None.
        reading: Mapping and corrections of the recordings.
        progress: Called with the share done, 0 to 1.
    """
    return fit_logs(read_to_fit(paths, reading), options, run, progress=progress)


def read_to_fit(paths: Sequence[Path], reading: Reading | None = None) -> list[MotionLog]:
    """Read recordings that models are fitted to; long ones, of several, lie on disk until their turn comes."""
    return of_each(lambda path, _: read_recording(path, reading), paths, kept=partial(_kept, of=len(paths)))


def _kept(log: MotionLog, of: int) -> MotionLog:
    """Return a recording, one of so many, on disk if it is long: others are looked at while it waits."""
    return on_disk(log) if of > 1 and len(log) > _MAX_ROWS_IN_MEMORY else log


@dataclass(frozen=True)
class EvaluationResult:
    """Errors of a model on recordings."""

    model: CalibrationModel
    card: Card
    evaluation: Evaluation
    notes: tuple[str, ...]
    seen_in_training: tuple[str, ...]  # recordings that the model was fitted to: their errors are no test

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in deg and mm."""
        evaluation = self.evaluation
        return {
            "model": {"kind": self.model.kind, "preset": self.model.preset, "target": self.model.target},
            "data": [asdict(source) for source in evaluation.data.sources],
            "simulated": any(source.simulated for source in evaluation.data.sources),
            "joints": [asdict(joint) for joint in evaluation.joints],
            "window_unit": evaluation.window_unit,
            "windows": [asdict(window) for window in evaluation.windows],
            "intervals": interval_summary(evaluation),
            "seen_in_training": list(self.seen_in_training),
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class HeldAgainst:
    """A model, read from its file with its card, and the recordings that it is held against.

    Whatever is asked of it first refuses recordings with which something is wrong, which is no fault of the model
    (DataError), that lack an input of the model, or are too short for what is asked (InputError).
    """

    path: Path
    model: CalibrationModel
    card: Card
    recordings: Recordings  # of the model's joints, mended as its training data were; limits as asked, or as in its fit
    accept: tuple[str, ...]  # names of findings about recordings to continue despite
    limit_notes: list[str]  # on the error limits

    @property
    def logs(self) -> tuple[MotionLog, ...]:
        """The recordings, joints in the model's order."""
        return self.recordings.logs

    def with_model(self, path: Path) -> "HeldAgainst":
        """Return the same recordings held against another model, of the same training data."""
        model, card = load_model(path)
        return replace(self, path=path, model=model, card=card)

    def evaluate(self, window: float | None = None) -> EvaluationResult:
        """Return the model's errors, also over windows of time [s], each a tenth of the data when None."""
        data = usable_rows(self.recordings, self.model.features)
        seen = tuple(log.name for log in self.logs if log.is_among(self.card["data"]))
        notes = [*data_notes(self.logs, data), *self.limit_notes, *self._judged("evaluated")]
        notes += [f"{name}: the model was fitted to rows of this recording: no independent test" for name in seen]
        evaluation = evaluate(self.model, data, window=window)
        return EvaluationResult(self.model, self.card, evaluation, (*notes, *warnings_of(evaluation)), seen)

    def drift(self, factor: float = DRIFT_FACTOR) -> tuple[DriftFound, list[str]]:
        """Return the model's errors over recordings, in the order given, and notes on these; see `find_drift`.

        `factor` is of the card's error, for a model without intervals.
        """
        notes = [*(note for log in self.logs for note in log.named_notes), *self.limit_notes]
        notes += self._judged("judged")
        return find_drift(self.model, self.recordings, known_errors(self.card), factor=factor), notes

    def refresh(self) -> NewDay:
        """Bring the model up to date with recordings of a new day, see `refresh_with`."""
        hashed = sha256_of(self.path)
        day = refresh_with(self.model, self.card, self.recordings, accept=self.accept, sha256=hashed)
        return replace(day, notes=(*day.notes, *self.limit_notes))

    def _judged(self, done: str) -> list[str]:
        return judge_recordings(self.model, self.recordings, accept=self.accept, done=done)


def held_against(
    model_path: Path,
    paths: Sequence[Path],
    reading: Reading | None = None,
    *,
    accept: Sequence[str] = (),
    max_error: tuple[float, ...] | None = None,
    own: str | None = None,
) -> HeldAgainst:
    """Read a model and recordings to evaluate it on; names and units that a recording lacks are the model's.

    Args:
        reading: Mapping and corrections of the recordings.
        accept: Names of findings to continue despite.
        max_error: Rows with larger errors are left out, per joint in deg and mm; as in the model's fit when None.
        own: Class or function of a model of your own, "module:name".
    """
    model, card = load_model(model_path, own)
    logs = recordings_for(model, paths, reading)
    max_error, notes = trained_limits(card, max_error, as_trained=reading is None or reading.as_trained)
    recordings = Recordings.of(logs, robot=card.get("robot"), max_error=max_error)
    return HeldAgainst(model_path, model, card, recordings, tuple(accept), notes)


def recordings_for(
    model: CalibrationModel | MotionLog, paths: Sequence[Path], reading: Reading | None = None
) -> list[MotionLog]:
    """Read recordings that a model is held against; see `recording_for`."""
    if not paths:
        raise InputError("data: expected at least one recording, got none")
    logs = [_kept(recording_for(model, path, reading), len(paths)) for path in paths]
    return [model.matched(log) for log in logs] if isinstance(model, CalibrationModel) else logs


def recording_for(model: CalibrationModel | MotionLog | None, path: Path, reading: Reading | None = None) -> MotionLog:
    """Read a recording and correct it as asked, and as the model's training data were.

    Args:
        model: Model, or recording that a model is fitted to, whose joint names and units hold where the recording
            states none; the recording alone when None.
        path, reading: The recording, and its mapping and corrections.
    """
    reading = reading if reading is not None else Reading()
    if model is None:
        return read_recording(path, reading)
    log = _read(model, path) if reading.mapping is None else _by_mapping(model, path, reading, reading.mapping)
    n, names = len(log.joint_names), model.joint_names
    if log.joint_names == nameless(n) and n == len(names) and not set(log.joint_names) & set(names):
        log = log.in_order_of(Joints(names), of="the model is for")  # which its mends name
    if isinstance(model, CalibrationModel) and reading.as_trained:
        return mended_as_trained(model, log, reading.mend)
    return reading.mend(log)


def _read(model: CalibrationModel | MotionLog, path: Path) -> MotionLog:
    if format_of(path).ending != ".npz":
        return read_log(path)
    content, n = read_arrays(path), len(model.joint_names)
    commands = content.get("q_des")
    if commands is not None and commands.ndim == 2 and commands.shape[1] != n:
        names = ", ".join(model.joint_names)
        raise InputError(f"{path}: has {commands.shape[1]} joints; the model is for {n}: {names}")
    units = None if "units" in content else model.joint_units
    return read_log(path, units=units, joint_names=None if "joint_names" in content else model.joint_names)


def _by_mapping(
    model: CalibrationModel | MotionLog, path: Path, reading: Reading, mapping: RecordingMapping
) -> MotionLog:
    """Read a recording by a mapping; joints without units there have the model's."""
    if not mapping.joint_units and mapping.robot is None:
        mapping = mapping.model_copy(update={"joint_units": model.joint_units})
    return read_recording(path, replace(reading, mapping=mapping, mend=Reading().mend))


def known_errors(card: Card) -> Floats | None:
    """Return errors per joint on data that a model did not see [deg|mm]: of its last refresh, or of its fit."""
    if card.get("refreshed"):
        return np.array([joint["rmse_after"] for joint in card["refreshed"][-1]["joints"]])
    if errors := card["errors"]["held_out"]:
        return np.array([joint["rmse"] for joint in errors])
    if errors := card["errors"]["cross_validation"]:
        return np.array([joint["rmse_mean"] for joint in errors["joints"]])
    return None


def card_history(paths: Sequence[Path], factor: float = DRIFT_FACTOR) -> DriftFound:
    """Return the history of errors, delays and zeros over days, from cards.

    Args:
        paths: Models, or cards beside them.
        factor: Ratio of errors from which a model counts as drifted.
    """
    cards = [
        json_table(read_bounded(path, MAX_JSON_BYTES), str(path)) if path.suffix == ".json" else load_model(path)[1]
        for path in paths
    ]
    names = [path.stem.removesuffix(".card") for path in paths]
    return find_card_drift([*zip(names, cards, map(known_errors, cards), strict=True)], factor=factor)


def drift_summary(drift: DriftFound, notes: Sequence[str] = ()) -> dict[str, Any]:
    """Return a drift report as plain data, errors in deg and mm.

    Args:
        notes: Further sentences.
    """
    return {
        "joints": drift.joint_names,
        "judged_by": drift.judged_by,
        "stretches": [asdict(stretch) for stretch in drift.stretches],
        "beyond_since": dict(zip(drift.joint_names, drift.since, strict=True)),
        "in_words": since_in_words(drift),
        "notes": list(notes),
    }


def warnings_of(evaluation: Evaluation) -> list[str]:
    """Return in words where a model does harm, or could not be asked; each opens with "warning: "."""
    doubts = []
    for joint in evaluation.joints:
        if joint.rmse > HARM_RATIO * joint.offset_rmse:
            errors = f"{joint.rmse:.3g} against {joint.offset_rmse:.3g} {joint.unit}"
            worse = "the model is worse than the fixed offset here"
            doubts.append(f"{joint.name}: {worse}, {errors}: do not deploy it on this joint")
        if joint.outside_valid_range > OUTSIDE_SHARE:
            share = f"{joint.outside_valid_range:.0%} of rows lie outside the model's valid range"
            doubts.append(f"{joint.name}: {share}, where it gives the fixed offset; train on motion that goes there")
    return [f"warning: {doubt}" for doubt in doubts]


def interval_summary(evaluation: Evaluation) -> dict[str, Any] | None:
    """Return the coverage of a model's intervals as plain data, in deg and mm; None for a model without."""
    if evaluation.level is None:
        return None
    verdicts = zip(evaluation.joints, coverage_verdicts(evaluation), strict=True)
    joints = [
        {"name": joint.name, "half_width": joint.half_width, "coverage": joint.coverage, "verdict": verdict}
        for joint, verdict in verdicts
    ]
    return {"coverage_asked": evaluation.level, "joints": joints}
