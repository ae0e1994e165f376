"""Which inputs recordings give a model, and the fit of one kind of model to rows of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, spread
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.extrapolation import TrainedRows, leverage_of
from catenary.calibration.features import FeatureSet, choose_signals, signals_of
from catenary.calibration.fit_options import FitOptions, FoundCables
from catenary.calibration.learned import BLOCKS, terms_of
from catenary.calibration.model import CalibrationModel, JointGroup, Target
from catenary.calibration.model_kinds import LEARNED
from catenary.calibration.predictors import Expansion
from catenary.calibration.recordings import Recordings
from catenary.calibration.spike_filter import ANY_SIZE, largest_step, room_of
from catenary.calibration.valid_range import fit_valid_range, standardisation
from catenary.errors import InputError
from catenary.parallel import Progress, part_of, silent
from catenary.plant import MotionLog

MIN_ROWS = 10  # rows
# of a signal's spread, that positions leave unexplained of one that they determine; rows that are compared
_DETERMINED_SHARE, _COMPARED_ROWS = 0.05, 4000
_SHOWN_QUANTILE = 0.99  # of training errors, for the largest correction: others may be failed measurements
_RESOLUTION_SI = 1e-6  # [rad|m] the smallest "largest correction": smaller ones no encoder shows


class Inputs(NamedTuple):
    """The features of a fit, and which joint takes which."""

    features: FeatureSet
    per_joint: tuple[tuple[str, ...], ...]  # (n,) signals
    determined: tuple[str, ...] = ()  # signals that are left out: the positions determine them in these recordings


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
    default = joint_inputs(log) if options.record.play_shares else ("q",) if log.tau is None else ("q", "tau")
    per_joint = tuple(choose_signals(log, inputs.get(joint, default)) for joint in log.joint_names)
    early = [log.part(0, max(1, round((1.0 - held_out) * len(log)))) for log in recordings.logs]
    determined = _determined(early, per_joint) if options.record.name == LEARNED else ()
    per_joint = tuple(tuple(name for name in names if name not in determined) for names in per_joint)
    signals = tuple(dict.fromkeys(name for names in per_joint for name in names))
    friction = None if options.friction is None else options.friction.states
    cables = FoundCables() if options.cables is None else options.cables
    paths = [path for path in cables.paths if {*path[1:3]} <= {*signals}]
    play: list[tuple[str, float]] = []
    steps: list[tuple[str, float]] = []
    own = [(name, name, name, 0.0) for joint in log.joint_names for name in [f"q:{joint}"] if name in signals]
    for along, *names, factor in [*own, *paths] if options.shares else []:
        first, second = (log.joint_names.index(str(name).removeprefix("q:")) for name in names)
        motions: list[tuple[Floats, Floats]] = []
        for log in early:
            rows = log.q_nominal[:, first] + factor * log.q_nominal[:, second], room_of(log, period)
            motions += zip(*(np.split(x, log.starts[1:]) for x in rows), strict=True)
        if (span := float(np.ptp(np.concatenate([q for q, _ in motions])))) > 0.0:
            step = largest_step(motions)
            play += [(along, share * span) for share in options.shares]
            play += [slack for slack in cables.slacks if slack[0] == along]
            steps += [(along, step)] if step > 0.0 else []
    if options.play and not play:
        raise InputError(f"play: none of the inputs {', '.join(signals)} is the position of a moved joint")
    units = tuple(unit for _, unit in map(signals_of(log).__getitem__, signals))
    whole = period if steps else None
    features = FeatureSet(signals, units, tuple(play), friction, tuple(steps), tuple(paths), whole)
    return Inputs(features, per_joint, determined)


def _determined(logs: Sequence[MotionLog], per_joint: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the signals that are functions of the positions on all rows, as gravity is on a base that stands.

    What such a signal does where it is no such function, as on a base that tilts, no row shows.
    """
    signals = tuple(dict.fromkeys(name for names in per_joint for name in names))
    positions = tuple(name for name in signals if name.startswith("q:"))
    others = tuple(name for name in signals if name not in positions)
    if not positions or not others:
        return ()
    known = signals_of(logs[0])
    sets = [FeatureSet(names, tuple(known[name][1] for name in names)) for names in (positions, others)]
    count = -(-_COMPARED_ROWS // len(logs))
    q, Y = (np.vstack([part.signal_rows(log)[spread(len(log), count)] for log in logs]) for part in sets)
    terms = terms_of(q, sets[0], np.arange(len(positions))).of(q)
    Z, Y = ((values - mean) / scale for values in (terms, Y) for mean, scale in [standardisation(values)])
    # of rows that the weights did not see: few rows are explained by as many terms, whatever they are
    weights = np.linalg.solve(Z[::2].T @ Z[::2] + np.eye(Z.shape[1]), Z[::2].T @ Y[::2])
    left = np.sqrt(np.mean(np.square(Y[1::2] - Z[1::2] @ weights), axis=0)) if len(Y) > 1 else np.ones(len(others))
    return tuple(name for name, share in zip(others, left, strict=True) if share < _DETERMINED_SHARE)


def joint_inputs(log: MotionLog) -> tuple[str, ...]:
    """Return the positions and, if recorded, torques of a log's own joints: what the learned model takes unasked.

    Of further ones, as of a tool whose positions repeat a joint's motor, a zig-zag shows what misleads elsewhere.
    """
    return tuple(f"{group}:{joint}" for group in ("q", *["tau"] * (log.tau is not None)) for joint in log.joint_names)


def fit_model(
    data: CalibrationData,
    inputs: Inputs,
    options: FitOptions,
    *,
    like: CalibrationModel | None = None,
    progress: Progress = silent,
) -> CalibrationModel:
    """Fit a model to rows, joints with the same inputs together.

    What blocks of time choose, as penalties, is taken from a model of the same inputs where one is given as `like`.
    """
    data.require(data, inputs.features)
    kind = options.record
    if len(data) < MIN_ROWS:
        raise InputError(f"data: {len(data)} usable rows, expected at least {MIN_ROWS}")
    offset = data.error.mean(axis=0)
    target: Target = "error" if kind.of_error else options.target
    Y = data.error if target == "error" else data.q_nominal + data.error
    groups: list[JointGroup] = []
    together: dict[tuple[str, ...], list[int]] = {}
    for joint, signals in enumerate(inputs.per_joint):
        together.setdefault(signals, []).append(joint)
    for number, (signals, joints) in enumerate(together.items()):
        columns = inputs.features.columns_of(signals)
        X = np.ascontiguousarray(data.X[:, columns])
        report = part_of(progress, number, len(together))
        chosen = None if like is None else like.groups[number].predictor
        predictor = kind.fit(
            X, Y[:, joints], ridge=options.ridge_used or 0.0, seed=options.seed, progress=report,
            features=inputs.features, columns=columns, joints=[data.joint_names[j] for j in joints],
            block=data.blocks(BLOCKS), recording=data.recording,
            penalties=chosen.penalties if isinstance(chosen, Expansion) else None, estimator=options.estimator,
        )  # fmt: skip
        if isinstance(predictor, Expansion) and predictor.leverage is None and kind.name not in ("offset", LEARNED):
            trained = TrainedRows(X, columns.tolist(), inputs.features, [data.joint_names[j] for j in joints])
            known = leverage_of(trained, predictor.terms, Y[:, joints], options.ridge_used or 0.0, data.blocks(BLOCKS))
            predictor = replace(predictor, leverage=known)
        watched = columns[~inputs.features.bounded[columns]]
        valid = fit_valid_range(data.X[:, watched], kind.beyond, along_axes=kind.along_axes)
        groups.append(JointGroup(tuple(joints), columns, predictor, valid, watched))
        report(1.0)
    anything, named = np.full(len(offset), ANY_SIZE), (data.joint_names, data.joint_units)
    model = CalibrationModel(
        kind.name, kind.preset, *named, inputs.features, target, offset, largest=anything, groups=tuple(groups)
    )
    return replace(model, largest=largest_shown(model, data))


def largest_shown(model: CalibrationModel, data: CalibrationData) -> Floats:
    """Return the largest correction shown, (n,) [rad|m]: the model's, or the error of all but the worst rows."""
    corrections = np.abs(model.correction(data.X, data.q_nominal)).max(axis=0)
    seen = np.quantile(np.abs(data.error), _SHOWN_QUANTILE, axis=0)
    largest: Floats = np.max([corrections, seen, np.abs(model.offset), np.full(len(seen), _RESOLUTION_SI)], axis=0)
    return largest
