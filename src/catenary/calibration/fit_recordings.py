"""A whole fit: which rows it sees, the model, its error on data that it did not see, and its card."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, partial

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.cable_search import find_cables, find_friction
from catenary.calibration.card import model_card
from catenary.calibration.conformal import DelayMargin, estimate_intervals, expected, fewest_rows, unseen_by_blocks
from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import CalibrationData, data_notes, usable_rows
from catenary.calibration.evaluate import CrossValidation, Evaluation, Spread, cross_validate, evaluate, rms
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_rows import MIN_ROWS, choose_inputs, fit_model
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.parallel import Progress, part_of, silent
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel
from catenary.robots.plausibility import MAX_LENGTH_M
from catenary.units import DISPLAY, TO_SI
from catenary.verdict.check import Passed
from catenary.verdict.command_response import OUTLIER_SIGMAS, outliers
from catenary.verdict.corrections import left_out_rows, mends_of

_MAX_ROWS, _SAMPLED_ROWS = 50_000, 20_000  # of more rows than the first a fit learns from a sample
_MAX_FAR_SHARE = 0.03  # of rows, that failed measurements are
_RESOLUTION_SI = 1e-7  # [rad|m] errors that no encoder shows
_LEFT_OUT_RATIO = 1.05  # times the RMSE without rows left out, that is worth a word
_DOUBTED_RATIO = 1.5  # times as large as on blocks may an error be elsewhere, that is worth a word
_ZERO_RATIO = 1.2  # times as large are errors before a recording's zero is known, that is worth a word
_UNTOLD_SHARE = 0.5  # of a joint's largest error, that its own delay may add and is worth a word
_VAGUE_RATIO = 2.0  # times its lower end, that a range of errors says little beyond

Rows = tuple[CalibrationData, CalibrationData | None, CalibrationData]


@dataclass(frozen=True)
class FitResult:
    """A fitted model, its card and its errors on data that it did not see."""

    model: CalibrationModel
    card: Card
    data: CalibrationData  # that it was fitted to
    spread: tuple[Spread, ...]
    held_out: Evaluation | None
    notes: tuple[str, ...]
    logs: tuple[MotionLog, ...] = ()


def fit_logs(
    logs: Sequence[MotionLog], options: FitOptions, run: FitRun | None = None, *, progress: Progress = silent
) -> FitResult:
    """Fit a model to recordings; see `fit_recordings`.

    Args:
        options, run: Model to fit; rows that the fit sees, and its tests.
        progress: Called with the share done, 0 to 1.
    """
    run = run if run is not None else FitRun()
    recordings = Recordings.of(logs, robot=run.robot, max_error=run.max_error)
    return fit_recordings(recordings, options, run, progress=progress)


def fit_recordings(
    recordings: Recordings, options: FitOptions, run: FitRun, *, progress: Progress = silent
) -> FitResult:
    """Fit a model to recordings, and evaluate it on blocks of time and a held-out part that it did not see.

    Args:
        options, run: Model to fit; rows that the fit sees, and its tests.
        progress: Called with the share done, 0 to 1.
    """
    options = options.of_kind(options.kind, options.preset)
    held_out = run.held_out or 0.0
    rows_of = cache(partial(_rows, recordings, run=run))
    rows_of(choose_inputs(recordings, options, held_out=held_out).features)  # refused before anything takes long
    passed = recordings.judged(run.accept, testing=options.is_function)  # from which nothing is learnt
    if options.takes_friction:
        options = replace(options, cables=find_cables(recordings, options, held_out=held_out))
        options = replace(options, friction=find_friction(recordings, options, held_out=held_out))
    inputs = choose_inputs(recordings, options, held_out=held_out)
    passed.notes.extend(_determined_notes(inputs.determined))
    rows = rows_of(inputs.features)
    data = rows[0]
    halves = [part_of(progress, k, 2) for k in range(2)]
    model = fit_model(data, inputs, options, progress=halves[0])
    validation: CrossValidation | None = None
    if run.folds:

        def refitted(part: CalibrationData, tell: Progress) -> CalibrationModel:
            return fit_model(part, inputs, options, like=model, progress=tell)

        validation = cross_validate(data, refitted, folds=run.folds, progress=halves[1])
    return _concluded(recordings, options, run, (model, validation), passed, rows)


def _determined_notes(signals: Sequence[str]) -> list[str]:
    """Return a note on inputs that were left out because the positions determine them."""
    why = "as positions alone determine it here, as they do gravity on a base that stands"
    remedy = "record on other bases, or with other loads, to use it"
    return [f"{', '.join(signals)}: left out, {why}; {remedy}"] * bool(signals)


def _far_notes(data: CalibrationData, left: Floats) -> list[str]:
    """Return notes on residuals (N, n) beyond ten robust deviations, if few, and on the RMSE without them."""
    far = np.any(np.abs(left) > OUTLIER_SIGMAS * outliers(left)[1] + _RESOLUTION_SI, axis=1)
    if not 0.0 < far.mean() <= _MAX_FAR_SHARE:
        return []
    what = f"{far.sum()} rows lie beyond {OUTLIER_SIGMAS:g} robust deviations of the model's errors"
    return [f"{what}, as failed measurements do; {_without(data, left[~far], left)}"]


def _zero_notes(data: CalibrationData, errors: CrossValidation) -> list[str]:
    """Say by how much zeros of recordings differ, where errors are larger before that of a new one is known."""
    if errors.zeros is None:
        return []
    known, unknown = np.square(errors.after_model).mean(axis=0), np.square(errors.of_others).mean(axis=0)
    sizes = [
        f"{data.joint_names[j]} {factor * rms(errors.zeros[:, j]):.2g} {unit}"
        for j in np.flatnonzero(unknown > _ZERO_RATIO**2 * known)
        for unit, factor in [DISPLAY[data.joint_units[j]]]
    ]
    condition = "errors are those at the lower end once a recording's zero is known (`catenary refresh`)"
    return [f"zeros of recordings differ by {', '.join(sizes)}: {condition}"] if sizes else []


def _vague_notes(spread: Sequence[Spread], unseen: DelayMargin) -> list[str]:
    """Return notes on joints that may err by several times as much as another minute, and on the motion to record."""
    ranges = [(s, s.rmse_low or 0.0, s.rmse_high or 0.0) for s in spread]
    vague = [f"{s.joint} {low:.3g} to {high:.3g} {s.unit}" for s, low, high in ranges if high > _VAGUE_RATIO * low]
    late = [rms / TO_SI[s.unit][1] for s, rms in zip(spread, unseen.rms, strict=True)]
    own = zip(ranges, late, unseen.even, strict=True)
    untold = ", ".join(s.joint for (s, _, high), size, even in own if even and size > _UNTOLD_SHARE * high)
    more = f", and half a minute of random motion, which shows whether {untold} alone is late" if untold else ""
    return [f"other minutes may err by {', '.join(vague)}, which says little: record longer{more}"] * bool(vague)


def _without(data: CalibrationData, kept: Floats, every: Floats) -> str:
    """Return in words the RMSE by joint of errors that are kept, and of all."""
    shown = [
        f"{name} {DISPLAY[unit][1] * rms(a):.3g} ({DISPLAY[unit][1] * rms(b):.3g}) {DISPLAY[unit][0]}"
        for name, unit, a, b in zip(data.joint_names, data.joint_units, kept.T, every.T, strict=True)
    ]
    return f"RMSE without (with) them: {', '.join(shown)}"


def _rows(recordings: Recordings, features: FeatureSet, run: FitRun) -> Rows:
    count = sum(len(log) for log in recordings.logs)
    every = 1 if count <= _MAX_ROWS else -(-count // _SAMPLED_ROWS)  # neighbours in a longer recording tell hardly more
    everything = usable_rows(recordings, features, every=every)
    data, late = everything, None
    if run.held_out is not None:
        data, late = everything.split_by_time(run.held_out)
    # data too few for the smallest fit of a run are refused before the longest one has run
    rows = len(data)
    smallest = rows - math.ceil(rows / run.folds) if run.folds else rows
    if rows < MIN_ROWS:
        raise InputError(f"data: {rows} usable rows, expected at least {MIN_ROWS}")
    if smallest < MIN_ROWS:
        raise InputError(
            f"data: {rows} usable rows; with one of {run.folds} blocks left out {smallest} remain, expected at least "
            f"{MIN_ROWS}; folds 0 disables cross-validation"
        )
    return data, late, everything


def _concluded(
    recordings: Recordings,
    options: FitOptions,
    run: FitRun,
    made: tuple[CalibrationModel, CrossValidation | None],  # None without folds
    passed: Passed,
    rows: Rows,
) -> FitResult:
    logs, (model, validation), (data, late, everything) = recordings.logs, made, rows
    notes = [*data_notes(logs, everything), *passed.notes]
    intervals, hidden, growth = None, None, np.ones(1)
    if validation is not None:
        plain = Intervals(run.coverage, np.ones_like(model.offset), np.ones_like(model.offset))
        growth = replace(model, intervals=plain).correct(data.X, data.q_nominal)[2]
        intervals = estimate_intervals(validation, level=run.coverage, growth=growth)
        hidden = unseen_by_blocks(logs, passed.delays, validation, _rates(logs, data), run.coverage)
    wider = None if intervals is None or hidden is None else hidden.in_intervals(intervals)
    model = replace(model, intervals=wider, limits=_limits(recordings.robot, data), mends=mends_of(logs))
    left = data.error - model.correction(data.X, data.q_nominal)
    notes += _far_notes(data, left)
    if model.features.friction is not None and options.friction is not None:
        coupled = ", ".join(position.removeprefix("q:") for position in model.features.friction.positions)
        gain = f"{options.friction.gain:.0%} of their error on blocks of time is explained by it"
        notes.append(f"friction couples {coupled}: {gain}")
    if model.features.paths:
        followed = ", ".join(name.replace("q:", "") for name, *_ in model.features.paths)
        notes.append(f"cables run over another joint's drum: play follows {followed}")
    seconds = None if options.record.in_c else Corrector(model).tick_seconds()
    if seconds is not None:
        notes.append(f"a tick of a loop takes {1e3 * seconds:.2g} ms here, in Python: the model has no C export")
    if options.is_function:
        notes.append("no block was left out of the function: its errors are a test if it has not seen the recordings")
    if validation is None:
        notes.append("no intervals: they are estimated from the cross-validation, which folds 0 leaves out")
    elif intervals is None:
        why = f"{len(validation.after_model)} rows are too few to hold {run.coverage:.0%} of errors"
        notes.append(f"no intervals: {why}; this needs {fewest_rows(run.coverage)}, or a lower coverage")
    unseen = None if validation is None or late is not None else validation.after_model
    notes += _left_out_notes(model, recordings, everything, unseen)
    spread: tuple[Spread, ...] = ()
    if validation is not None and hidden is not None:
        widening = np.ones_like(model.offset) if model.widening is None else model.widening
        spread = expected(validation, left, intervals, widening, growth, hidden)
        if wide := [f"{s.joint} {w:.2g}" for s, w in zip(spread, widening, strict=True) if w > _DOUBTED_RATIO]:
            warning = f"where joints meet that its training has apart, errors may be more: {', '.join(wide)} times"
            notes.append(f"{warning}; record random motion")
        notes += _vague_notes(spread, hidden)
        notes += _zero_notes(data, validation)
    held_out = None if late is None else evaluate(model, late)
    card = model_card(model, data, options, run=run, spread=spread, held_out=held_out, notes=tuple(notes))
    card["delays"] = [
        {"recording": log.name, **({} if delay is None else asdict(delay))}
        for log, delay in zip(logs, passed.delays, strict=True)
    ]
    if seconds is not None:
        card["tick_seconds"] = seconds
    return FitResult(model, card, data, spread, held_out, tuple(notes), logs)


def _rates(logs: Sequence[MotionLog], data: CalibrationData) -> Floats:
    """Return speeds (N, n) [rad/s|m/s] on rows of data; per row of recordings without stamps."""
    rates = np.empty_like(data.q_nominal)
    for number, log in enumerate(logs):
        rows = data.recording == number
        at = log.time if data.has_time and log.time is not None else np.arange(len(log))
        rate = np.nan_to_num(np.gradient(log.q_nominal, at, axis=0), posinf=0.0, neginf=0.0)
        rates[rows] = np.column_stack([np.interp(data.time[rows], at, column) for column in rate.T])
    return rates


def _limits(robot: RobotModel | None, data: CalibrationData) -> Floats | None:
    """Return a robot's joint limits (2, n) [rad|m], or where rows went beyond them; None if it is not known."""
    joints, q = list(zip(data.joint_names, data.joint_units, strict=True)), data.q_nominal
    known = [] if robot is None else list(zip(robot.joint_names, robot.joint_units, strict=True))
    if robot is None or not set(joints) <= set(known):
        return None
    places = [known.index(joint) for joint in joints]
    lower = np.minimum(robot.lower[places], q.min(axis=0))
    upper = np.maximum(robot.upper[places], q.max(axis=0))
    limits: Floats = np.clip([lower, upper], -MAX_LENGTH_M, MAX_LENGTH_M)  # a joint may have none
    return limits


def _left_out_notes(
    model: CalibrationModel, recordings: Recordings, data: CalibrationData, left: Floats | None
) -> list[str]:
    """Say the RMSE with measured rows left out (--max-error, --leave-out), where it is larger.

    Errors left (N, n) are of models that did not see the rows; the model's when None.
    """
    left_out = [left_out_rows(log) for log in recordings.logs]
    if not any(source.dropped for source in data.sources) and not any(rows.any() for rows in left_out):
        return []
    logs = (replace(log, ok=log.ok | rows) for log, rows in zip(recordings.logs, left_out, strict=True))
    every = usable_rows(Recordings(tuple(logs)), model.features, every=data.every)
    gone = every.rows(~np.isin(every.recording + every.position, data.recording + data.position))
    left = data.error - model.correction(data.X, data.q_nominal) if left is None else left
    both = np.vstack([left, gone.error - model.correction(gone.X, gone.q_nominal)])
    if not (np.square(both).mean(axis=0) > _LEFT_OUT_RATIO**2 * np.square(left).mean(axis=0)).any():
        return []
    what = f"dropped: {len(gone)} rows left out carry more than their share of the error"
    return [f"{what} (measurement failures; or a true error that was cut away); {_without(data, left, both)}"]
