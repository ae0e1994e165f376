"""Which inputs recordings give a model, and the fit of one kind of model to rows of them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.features import FeatureSet, choose_signals, signals_of
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.midline import RADIUS_SHARE, TRAVEL_SHARE, Midline
from catenary.calibration.model import CalibrationModel, JointGroup, Target
from catenary.calibration.model_kinds import ModelKind
from catenary.calibration.recording_zeros import recording_zeros
from catenary.calibration.recordings import Recordings
from catenary.calibration.spike_filter import ANY_SIZE, largest_step, room_of
from catenary.calibration.valid_range import fit_valid_range
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.side_by_side import Progress, part_of, silent

MIN_ROWS = 10  # rows
_BEYOND_AXES = 1.0  # of the range along a principal axis, how far a model may go; see `ModelKind`
_MIN_KNOWN_SHARE = 0.5  # share of rows on which a midline is known
# share of training errors that count for the largest correction: the others may be failed measurements
_SHOWN_QUANTILE = 0.99
_RESOLUTION_SI = 1e-6  # [rad|m] the smallest "largest correction": smaller ones no encoder shows


class Inputs(NamedTuple):
    """The features of a fit, and which joint takes which."""

    features: FeatureSet
    per_joint: tuple[tuple[str, ...], ...]  # (n,) signals


def choose_inputs(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> Inputs:
    """Choose the features for recordings, looking only at what comes before their held-out last part."""
    log, period = recordings.logs[0], recordings.period
    if isinstance(options.inputs, Mapping):
        for joint in options.inputs:
            if joint not in log.joint_names:
                raise InputError(f'inputs of joint "{joint}": no such joint; joints: {", ".join(log.joint_names)}')
        inputs = dict(options.inputs)
    else:
        inputs = {} if options.inputs is None else dict.fromkeys(log.joint_names, options.inputs)
    default = ("q",) if log.tau is None else ("q", "tau")
    per_joint = tuple(choose_signals(log, inputs.get(joint, default)) for joint in log.joint_names)
    found = options.friction if options.takes_friction(name for names in per_joint for name in names) else None
    friction = None if found is None else found.states
    if found is not None:
        per_joint = tuple(
            found.signals if joint in found.joints else taken
            for joint, taken in zip(log.joint_names, per_joint, strict=True)
        )
    signals = tuple(dict.fromkeys(name for names in per_joint for name in names))
    coupled = () if friction is None else friction.positions
    shares = options.play_shares(signals)
    early = [each.part(0, max(1, round((1.0 - held_out) * len(each)))) for each in recordings.logs]
    play: list[tuple[str, float]] = []
    steps: list[tuple[str, float]] = []
    midlines = _midlines(early, signals) if options.record is not None and options.record.midlines else []
    for name in signals if shares else coupled:
        joint = name.removeprefix("q:")
        if name.startswith("q:") and joint in log.joint_names:
            column = log.joint_names.index(joint)
            motions: list[tuple[Floats, Floats]] = []
            for each in early:
                rows = each.q_nominal[:, column], room_of(each, period)
                motions += zip(*(np.split(x, each.starts[1:]) for x in rows), strict=True)
            if (span := float(np.ptp(np.concatenate([q for q, _ in motions])))) > 0.0:
                step = largest_step(motions)
                play += [(name, share * span) for share in shares if name not in coupled]
                steps += [(name, step)] if step > 0.0 else []
    if options.play and not (play or coupled):
        raise InputError(f"play: none of the inputs {', '.join(signals)} is the position of a joint that moved")
    units = tuple(unit for _, unit in map(signals_of(log).__getitem__, signals))
    whole = period if steps else None
    features = FeatureSet(signals, units, tuple(play), tuple(midlines), friction, tuple(steps), whole)
    return Inputs(features, per_joint)


def _midlines(logs: Sequence[MotionLog], signals: Sequence[str]) -> list[Midline]:
    """Return midlines of the torques and currents among signals, where motion turns often enough to show them."""
    found = []
    for name in signals:
        joint = _joint_of(logs[0], name)
        position = f"q:{joint}"
        if joint is None or position not in signals:
            continue
        span = float(np.ptp(np.concatenate([log.q_nominal[:, log.joint_names.index(joint)] for log in logs])))
        if span > 0.0:
            midline = (name, position, RADIUS_SHARE * span, TRAVEL_SHARE * span)
            units = tuple(signals_of(logs[0])[each][1] for each in (position, name))
            alone = FeatureSet((position, name), units, midlines=(midline,))
            known = np.concatenate([np.isfinite(alone.matrix(log)[:, -1]) for log in logs])
            found += [midline] if known.mean() >= _MIN_KNOWN_SHARE else []
    return found


def _joint_of(log: MotionLog, name: str) -> str | None:
    """Return the joint whose torque or current a signal is: "tau:J1", "current[0]", "current" of a single joint."""
    group, _, joint = name.partition(":")
    if group in ("q", "qd"):
        return None
    numbered = re.fullmatch(r".*\[(\d+)\]", name)
    if numbered and int(numbered[1]) < len(log.joint_names):
        joint = log.joint_names[int(numbered[1])]
    elif len(log.joint_names) == 1:
        joint = log.joint_names[0]
    return joint if joint in log.joint_names else None


def fit(data: CalibrationData, inputs: Inputs, options: FitOptions, *, progress: Progress = silent) -> CalibrationModel:
    """Fit a model to complete rows, joints with the same inputs together, zeros of several recordings left out."""
    data = data.rows(data.complete)
    data.require(data, inputs.features)
    kind = options.record
    if kind is None:
        raise InputError("model auto: is chosen from whole recordings; fit one kind to rows")
    if len(data) < MIN_ROWS:
        raise InputError(f"data: {len(data)} usable rows, expected at least {MIN_ROWS}")
    offset = data.error.mean(axis=0)
    target: Target = "error" if kind.of_error else options.target
    Y = data.error if target == "error" else data.q_nominal + data.error
    groups: list[JointGroup] = []
    together: dict[tuple[str, ...], list[int]] = {}
    for joint, signals in enumerate(inputs.per_joint):
        together.setdefault(signals, []).append(joint)
    late = data.position >= 0.8 * data.position.max()  # the last fifth of what is trained on
    for number, (signals, joints) in enumerate(together.items()):
        columns = inputs.features.columns_of(signals)
        X = np.ascontiguousarray(data.X[:, columns])
        report = part_of(progress, number, len(together))
        learnt = Y[:, joints]
        if not kind.as_recorded:
            learnt = learnt - recording_zeros(X, learnt, data.recording)[data.recording]
        given = {"ridge": options.ridge_used or 0.0, "seed": options.seed, "late": late, "progress": report}
        predictor = kind.fit(X, learnt, **given)
        watched = columns[~inputs.features.bounded[columns]]
        margin = extrapolation(kind, inputs.features, columns)
        along_axes = margin if kind.is_power else _BEYOND_AXES
        averaged = inputs.features.averaged[watched]
        valid = fit_valid_range(data.X[:, watched], margin, along_axes=along_axes, farther=averaged)
        groups.append(JointGroup(tuple(joints), columns, predictor, valid, watched))
        report(1.0)
    anything, named = np.full(len(offset), ANY_SIZE), (data.joint_names, data.joint_units)
    model = CalibrationModel(
        kind.name, kind.preset, *named, inputs.features, target, offset, largest=anything, groups=tuple(groups)
    )
    return replace(model, largest=largest_shown(model, data))


def largest_shown(model: CalibrationModel, data: CalibrationData) -> Floats:
    """Return the largest correction shown, (n,) [rad|m]: the model's, or the error of all but the worst rows."""
    given = np.abs(model.correction(data.X, data.q_nominal)).max(axis=0)
    seen = np.quantile(np.abs(data.error), _SHOWN_QUANTILE, axis=0)
    largest: Floats = np.max([given, seen, np.abs(model.offset), np.full(len(seen), _RESOLUTION_SI)], axis=0)
    return largest


def extrapolation(kind: ModelKind, features: FeatureSet, columns: Integers) -> float:
    """Return how far beyond training a kind may go, as a share of its range; columns behind the signals are memory."""
    return kind.beyond_with_memory if (columns >= len(features.signals)).any() else kind.beyond
