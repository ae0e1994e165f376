"""Fit, evaluate, refresh, save and load calibration models from Python: `catenary.fit`, `catenary.evaluate` and more.

A motion is an array `q_nominal` (N, n) of reported positions, with its other quantities as keyword arguments; or a
MotionLog, the path of a log, or several of these.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import usable_rows
from catenary.calibration.evaluate import Evaluation, Spread, spread_table
from catenary.calibration.evaluate import evaluate as evaluate_rows
from catenary.calibration.fit_options import COVERAGE, FOLDS, FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.calibration.model import CalibrationModel, Card, Target
from catenary.calibration.model_file import load_model as read_model
from catenary.calibration.model_file import save_model
from catenary.calibration.model_kinds import LEARNED
from catenary.calibration.model_maintenance import judge_recordings, mended_as_trained, refresh_with, trained_limits
from catenary.calibration.own_model import Function, Named, chosen
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.parallel import Progress, silent
from catenary.plant import MotionLog, nameless
from catenary.recording.logs import read_log
from catenary.tables import Screen
from catenary.verdict.check import findings_of, robot_of
from catenary.verdict.corrections import AS_TRAINED
from catenary.verdict.finding import Finding

Recording = MotionLog | str | Path
_ARRAYS_NAME = "arrays"  # name of the log made of arrays
_log = logging.getLogger(__name__)
Motion = ArrayLike | Recording | Sequence[Recording]


class MotionArrays(TypedDict, total=False):
    """Further arrays of a motion whose positions q_nominal (N, n) are an array."""

    tau: ArrayLike | None  # (N, n) joint torques [Nm|N]
    qd: ArrayLike | None  # (N, n) joint velocities [rad/s|m/s]
    time: ArrayLike | None  # (N,) [s]; a step back starts another motion


@dataclass(frozen=True, repr=False)
class Calibration(CalibrationModel):
    """A fitted calibration model with its card, which states the training data and the errors.

    Recordings (not arrays) are corrected as its training data were; `dataclasses.replace(model, mends={})` disables it.

    Examples:
        >>> q = np.sin(np.linspace(0.0, 60.0, 1800))[:, None]
        >>> model = catenary.fit(q, 1.03 * q, units=["rad"], model="linear")
        >>> model.joint_names, model.kind
        (('J1',), 'linear')
    """

    card: Card = field(default_factory=dict)

    @property
    def screen(self) -> Screen:
        """Corrections, and errors on blocks of time that the fit did not see."""
        own, errors = super().screen, self.card.get("errors", {}).get("cross_validation")
        crossed = [spread_table([Spread(**joint) for joint in errors["joints"]])] if errors else []
        named = f"{self.card['robot']}, " if self.card.get("robot") else ""
        verdict = "; ".join(self.card.get("notes", ()))
        return Screen(f"{named}{own.title}, {self.card.get('rows', 0):,} rows", [*crossed, *own.tables], verdict)

    def predict(self, q_nominal: Motion, **arrays: Unpack[MotionArrays]) -> Floats:
        """Return the estimated true joint positions (N, n) [rad|m]; outside the valid range the fixed offset is added.

        Args:
            q_nominal: (N, n) reported positions [rad|m], or recordings.
            arrays: `tau`, `qd` and `time` if the model takes them and positions are an array; see MotionArrays.

        Raises:
            InputError: Wrong number of joints, NaN, or a missing input of the model.
        """
        return np.concatenate([self.calibrate(log) for log in self._logs(q_nominal, **arrays)])

    def predict_interval(self, q_nominal: Motion, **arrays: Unpack[MotionArrays]) -> Floats:
        """Return half-widths (N, n) [rad|m] of intervals about the calibrated positions; arguments as in `predict`.

        They are meant to contain a share `intervals.level` of the errors; NaN if the model has no intervals.
        """
        return np.concatenate([self.half_widths(log) for log in self._logs(q_nominal, **arrays)])

    def evaluate(
        self,
        q_nominal: Motion,
        q_encoder: ArrayLike | None = None,
        *,
        window: float | None = None,
        accept: Sequence[str] = (),
        **arrays: Unpack[MotionArrays],
    ) -> Evaluation:
        """Evaluate the model on data that it was not fitted to; see `catenary.evaluate`."""
        recordings = self._recordings(q_nominal, q_encoder, **arrays)
        data = usable_rows(recordings, self.features)
        judge_recordings(self, recordings, accept=accept)
        return evaluate_rows(self, data, window=window)

    def refresh(
        self,
        q_nominal: Motion,
        q_encoder: ArrayLike | None = None,
        *,
        accept: Sequence[str] = (),
        **arrays: Unpack[MotionArrays],
    ) -> Calibration:
        """Update the model with minutes of a new day; its card states what changed. See `catenary.refresh`."""
        day = refresh_with(self, self.card, self._recordings(q_nominal, q_encoder, **arrays), accept=accept)
        return _with_card(day.model, day.card)

    def corrector(self, *, rate_hz: float = 1000.0) -> Corrector:
        """Return the model for a control loop; see `Corrector`."""
        return Corrector(self, rate_hz=rate_hz)

    def _recordings(self, motion: Motion, q_encoder: ArrayLike | None, **arrays: Unpack[MotionArrays]) -> Recordings:
        logs = self._logs(motion, q_encoder, **arrays)
        return Recordings.of(logs, robot=self.card.get("robot"), max_error=trained_limits(self.card)[0])

    def _logs(
        self, motion: Motion, q_encoder: ArrayLike | None = None, **arrays: Unpack[MotionArrays]
    ) -> list[MotionLog]:
        """Return recordings with the model's joints, corrected as its training data were; arrays are not corrected."""
        logs = _logs(motion, self.joint_names, self.joint_units, q_encoder, **arrays)
        if logs[0].name != _ARRAYS_NAME:
            logs = [mended_as_trained(self, self.matched(log)) for log in logs]
        for note in [f"{log.name}: {n}" for log in logs for n in log.notes if n.startswith(AS_TRAINED)]:
            _log.warning(note)
        return [self.matched(log) for log in logs]

    def save(self, path: str | Path) -> None:
        """Write the model to a file (.npz) and a readable copy of its card next to it."""
        save_model(self, self.card, Path(path))


def load_model(path: str | Path, *, own: Named | Sequence[Named] | None = None) -> Calibration:
    """Read a calibration model that `Calibration.save` or `catenary fit` wrote.

    Args:
        own: Class or function of a custom model, or its "module:name"; a sequence if it consists of several. Without
            it the model shows its card but cannot run.

    Raises:
        FileFormatError: The file is not a calibration model.
        InputError: The model's class differs from `own`, or it holds types of packages whose classes are not named.

    Examples:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> q = np.sin(np.linspace(0.0, 60.0, 1800))[:, None]
        >>> path = Path(mkdtemp()) / "model.npz"
        >>> catenary.fit(q, 1.03 * q, units=["rad"], model="linear").save(path)
        >>> catenary.load_model(path).kind
        'linear'
    """
    model, card = read_model(Path(path), own)
    return _with_card(model, card)


def fit(
    q_nominal: Motion,
    q_encoder: ArrayLike | None = None,
    *,
    units: Sequence[str] | None = None,
    joint_names: Sequence[str] | None = None,
    model: object = LEARNED,
    preset: str | None = None,
    inputs: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    play: Sequence[float] | None = None,
    target: Target = "error",
    ridge: float | None = None,
    max_error: Sequence[float] | None = None,
    held_out: float | None = None,
    folds: int = FOLDS,
    coverage: float = COVERAGE,
    robot: str | None = None,
    seed: int = 0,
    coupled: Sequence[str] | None = None,
    accept: Sequence[str] = (),
    progress: Progress = silent,
    **arrays: Unpack[MotionArrays],
) -> Calibration:
    """Fit a calibration model: the correction that is added to the reported joint positions.

    Args:
        q_nominal: (N, n) reported positions [rad|m], rows in the order of time; or recordings.
        q_encoder: (N, n) true positions [rad|m]; NaN on rows without a measurement. Recordings have their own.
        units: "rad" or "m" per joint; needed for arrays.
        joint_names: Names of the joints; J1, J2, ... if None.
        model: "learned", or one of the papers': "offset", "linear", "polynomial" or "neural". Or your own: an estimator
            with scikit-learn's fit, predict and get_params, whose clones are fitted; or a function that maps features
            (N, F) to the `target` (N, n) [rad|m].
        preset: For "neural": "paper".
        inputs: Groups ("q", "tau", "qd"), signals ("q:J1"), or these per joint; positions and torques if None
            (for "learned" and your own, of the model's joints only).
        play: Half-widths of play states as shares of each joint's range; see FitOptions. Your own estimator takes the
            features of "learned", or with () only the recorded signals.
        target: "error", or "position" for an end-to-end model.
        ridge: Weight on the squared coefficients of a regression.
        max_error: Leave out rows with larger errors, per joint in deg and mm.
        held_out: Share at the end of each recording that is excluded from the fit; the card states the errors on it.
        folds: Time blocks of the cross-validation; 0 for none, which is fast but gives no intervals.
        coverage: Share of errors that the intervals about calibrated positions are meant to contain.
        robot: Name of the robot for the card; that of the recordings if None.
        seed: Random seed of a network's training.
        coupled: Joints that friction couples; found in the recordings if None, none if empty.
        accept: Names of `check_data` findings that do not stop the fit.
        progress: Called with the completed share, 0 to 1.
        arrays: `tau` and `qd` (N, n), `time` (N,), if positions are an array; torques are inputs by default.

    Raises:
        DataError: Something is wrong with the data; the message states what, how to fix it, and how to accept it.
        InputError: Arrays of inconsistent shapes, too few rows, or contradictory options.
        FileFormatError: A recording is missing or damaged.

    Examples:
        >>> t = np.linspace(0.0, 60.0, 1800)
        >>> q = np.column_stack([np.sin(t), 0.1 * np.cos(1.7 * t)])
        >>> truth = q + [0.02, 0.001] + 0.03 * q
        >>> model = catenary.fit(q, truth, units=["rad", "m"], model="linear")
        >>> bool(np.abs(model.predict(q) - truth).max() < 1e-9)
        True
    """
    logs = _logs(q_nominal, joint_names, units, q_encoder, **arrays)
    shares, limits = (None if values is None else tuple(values) for values in (play, max_error))
    pair = None if coupled is None else tuple(coupled)
    kind, estimator = chosen(model)
    options = FitOptions(kind, preset, inputs, shares, target, ridge, seed, pair, estimator=estimator)
    run = FitRun(robot, limits, held_out, folds, tuple(accept), coverage)
    result = fit_logs(logs, options, run, progress=progress)
    return _with_card(result.model, result.card)


def check_data(
    q_nominal: Motion,
    q_encoder: ArrayLike | None = None,
    *,
    units: Sequence[str] | None = None,
    joint_names: Sequence[str] | None = None,
    robot: str | None = None,
    **arrays: Unpack[MotionArrays],
) -> tuple[Finding, ...]:
    """Return findings about recordings, most severe first, before a model is fitted to them.

    Args:
        q_nominal, q_encoder, units, joint_names, **arrays: As in `fit`.
        robot: Catalogue name or file of the robot whose limits positions are compared with.

    Returns:
        Findings; `fit` refuses data with a finding whose `refuses` is true, unless its `name` is accepted.

    Examples:
        >>> q = np.sin(np.linspace(0.0, 60.0, 1800))[:, None]
        >>> [finding.name for finding in catenary.check_data(q, np.rad2deg(q), units=["rad"]) if finding.refuses]
        ['units', 'copied']
    """
    logs = _logs(q_nominal, joint_names, units, q_encoder, **arrays)
    model = robot_of(logs, robot)
    return tuple(finding for log in logs for finding in findings_of(log, robot=model))


def evaluate(
    model: Calibration | str | Path | Function,
    q_nominal: Motion,
    q_encoder: ArrayLike | None = None,
    *,
    window: float | None = None,
    accept: Sequence[str] = (),
    **arrays: Unpack[MotionArrays],
) -> Evaluation:
    """Evaluate a model on data that it was not fitted to, against no correction and a fixed offset.

    Args:
        model: Model or its file; or a function of your own, as in `fit`.
        q_nominal, q_encoder, accept, **arrays: As in `fit`.
        window: Length of a time window of the report [s]; a tenth of the data if None.

    Raises:
        DataError: Something is wrong with the data, such as other units.
        InputError: Arrays of inconsistent shapes, or joints other than the model's.

    Examples:
        >>> t = np.linspace(0.0, 60.0, 1800)
        >>> q = np.column_stack([np.sin(t), 0.1 * np.cos(1.7 * t)])
        >>> truth = q + [0.02, 0.001] + 0.03 * q
        >>> model = catenary.fit(q[:1200], truth[:1200], units=["rad", "m"], model="linear")
        >>> errors = catenary.evaluate(model, q[1200:], truth[1200:])
        >>> [joint.name for joint in errors.joints if joint.rmse < joint.offset_rmse]
        ['J1', 'J2']
    """
    if not isinstance(model, Calibration | str | Path):
        if hasattr(model, "fit"):
            raise InputError("model: an estimator is fitted first: catenary.fit(recordings, model=estimator)")
        model = fit(q_nominal, q_encoder, model=model, folds=0, accept=accept, **arrays)
    loaded = model if isinstance(model, Calibration) else load_model(model)
    return loaded.evaluate(q_nominal, q_encoder, window=window, accept=accept, **arrays)


def refresh(
    model: Calibration | str | Path,
    q_nominal: Motion,
    q_encoder: ArrayLike | None = None,
    *,
    accept: Sequence[str] = (),
    **arrays: Unpack[MotionArrays],
) -> Calibration:
    """Update a model with minutes of a new day.

    Args:
        model: Model or its file.
        q_nominal, q_encoder, accept, **arrays: As in `fit`.

    Raises:
        DataError: Something is wrong with the data.
        InputError: Joints other than the model's, or a recording that the model was fitted to.

    Examples:
        >>> q = np.sin(np.linspace(0.0, 60.0, 1800))[:, None]
        >>> model = catenary.fit(q, 1.03 * q, units=["rad"], model="linear")
        >>> today = catenary.refresh(model, q, 1.03 * q + 0.01)
        >>> bool(np.abs(today.predict(q) - 1.03 * q - 0.01).max() < 1e-3)
        True
    """
    loaded = model if isinstance(model, Calibration) else load_model(model)
    return loaded.refresh(q_nominal, q_encoder, accept=accept, **arrays)


def _with_card(model: CalibrationModel, card: Card) -> Calibration:
    return Calibration(**{field.name: getattr(model, field.name) for field in fields(CalibrationModel)}, card=card)


def _logs(
    motion: Motion,
    joint_names: Sequence[str] | None,
    units: Sequence[str] | None,
    q_encoder: ArrayLike | None = None,
    *,
    tau: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    time: ArrayLike | None = None,
) -> list[MotionLog]:
    quantities = {"q_encoder": q_encoder, "tau": tau, "qd": qd, "time": time}
    recordings = [motion] if isinstance(motion, Recording) else motion
    if isinstance(recordings, Sequence) and recordings and all(isinstance(item, Recording) for item in recordings):
        recorded = [name for name, values in quantities.items() if values is not None]
        if recorded:
            raise InputError(f"{', '.join(recorded)}: recordings have their own; expected arrays with arrays only")
        return [
            item if isinstance(item, MotionLog) else read_log(item, units=units, joint_names=joint_names)
            for item in recordings
        ]
    q = as_array("q_nominal", motion, (None, None))  # type: ignore[arg-type]  # no recordings: an array
    if units is None:
        raise InputError(f'units: expected "rad" or "m" for each of the {q.shape[1]} joints of q_nominal')
    arrays: dict[str, Any] = {
        name: as_array(name, values, q.shape[:1] if name == "time" else q.shape, finite=name != "q_encoder")
        for name, values in quantities.items()
        if values is not None
    }
    ok = np.isfinite(arrays.get("q_encoder", q)).all(axis=1)
    return [MotionLog(_ARRAYS_NAME, tuple(joint_names or nameless(q.shape[1])), tuple(units), q, ok, **arrays)]
