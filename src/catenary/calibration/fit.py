"""From recordings to a calibration model, of whichever kind."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.features import FeatureSet, choose_signals, signal_unit
from catenary.calibration.linear import fit_linear
from catenary.calibration.model import CalibrationModel, JointGroup, Predictor, Target
from catenary.calibration.neural import BEST, PAPER, fit_neural
from catenary.calibration.offset import fit_offset
from catenary.calibration.polynomial import fit_polynomial
from catenary.calibration.progress import Progress, part_of, silent
from catenary.calibration.valid_range import fit_valid_range
from catenary.errors import InputError
from catenary.plant import MotionLog

Kind = Literal["offset", "linear", "polynomial", "neural"]
Preset = Literal["paper", "best"]
KINDS: tuple[str, ...] = get_args(Kind)
PRESETS: tuple[str, ...] = get_args(Preset)
# half-widths of the play states, as shares of each joint's range of motion: from a cable's slack to its stretch
PLAY_SHARES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
MEMORY_RIDGE = 10.0  # for regressions on features with memory, which resemble each other
SMALLEST_DATA = 10  # rows


@dataclass(frozen=True)
class FitOptions:
    """What to fit.

    `inputs` names signals or groups of signals, for all joints or per joint; None takes the positions and, if
    recorded, the torques. `play` adds play states of the positions, as shares of each joint's range of motion;
    None means none, except for the neural preset `best` where no torque is recorded: torque, too, tells on which
    side of its slack a cable lies, and then play states only add what can be over-fitted.
    """

    kind: Kind = "linear"
    preset: Preset | None = None  # of kind neural; "paper" when None
    inputs: tuple[str, ...] | dict[str, tuple[str, ...]] | None = None
    history: int = 0
    play: tuple[float, ...] | None = None
    target: Target = "error"
    ridge: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f'model "{self.kind}": expected one of {", ".join(KINDS)}')
        if self.preset is not None and (self.preset not in PRESETS or self.kind != "neural"):
            raise InputError(
                f'preset "{self.preset}" of model "{self.kind}": only neural has presets, {" and ".join(PRESETS)}'
            )
        if self.target not in get_args(Target):
            raise InputError(f'target "{self.target}": expected one of {", ".join(get_args(Target))}')
        if self.history < 0:
            raise InputError(f"history: expected zero or more previous commands, got {self.history}")
        if any(not 0.0 < share < 1.0 for share in self.play or ()):
            raise InputError(f"play: expected shares of the range of motion between 0 and 1, got {self.play}")
        if self.ridge is not None and not self.ridge >= 0.0:
            raise InputError(f"ridge: expected zero or more, got {self.ridge}")

    def play_shares(self, signals: Sequence[str]) -> tuple[float, ...]:
        """Shares of each joint's range of motion that the play states take beside the given signals."""
        if self.play is not None:
            return self.play
        torque = any(name.startswith("tau:") for name in signals)
        return PLAY_SHARES if self.preset == "best" and not torque else ()


@dataclass(frozen=True)
class Inputs:
    """The features of a fit, and which joint takes which."""

    features: FeatureSet
    per_joint: tuple[tuple[str, ...], ...] = field(default=())  # (n,) signals


def choose_inputs(logs: Sequence[MotionLog], options: FitOptions, *, held_out: float = 0.0) -> Inputs:
    """Settle the features for recordings, looking only at what comes before their held-out last part.

    Raises:
        InputError: An input or a joint that the recordings do not have.
    """
    log = logs[0]
    if isinstance(options.inputs, dict):
        for joint in options.inputs:
            if joint not in log.joint_names:
                raise InputError(
                    f'inputs of joint "{joint}": no such joint; joints: {", ".join(log.joint_names)}'
                )
        default = _default_words(log)
        per_joint = tuple(
            choose_signals(log, options.inputs.get(joint, default)) for joint in log.joint_names
        )
    else:
        words = _default_words(log) if options.inputs is None else options.inputs
        per_joint = (choose_signals(log, words),) * len(log.joint_names)
    signals = tuple(dict.fromkeys(name for names in per_joint for name in names))
    shares = options.play_shares(signals)
    play: list[tuple[str, float]] = []
    for name in signals:
        joint = name.removeprefix("q:")
        if name.startswith("q:") and joint in log.joint_names:
            column = log.joint_names.index(joint)
            commands = [
                each.q_nominal[: max(1, round((1.0 - held_out) * len(each))), column] for each in logs
            ]
            low, high = min(float(c.min()) for c in commands), max(float(c.max()) for c in commands)
            if high > low:
                play += [(name, share * (high - low)) for share in shares]
    units = tuple(signal_unit(log, name) for name in signals)
    return Inputs(FeatureSet(signals, units, options.history, tuple(play)), per_joint)


def fit(
    data: CalibrationData, inputs: Inputs, options: FitOptions, *, progress: Progress = silent
) -> CalibrationModel:
    """Fit a calibration model to rows of data.

    Joints with the same inputs are fitted together.

    Raises:
        InputError: Fewer rows than any fit needs.
    """
    if len(data) < SMALLEST_DATA:
        raise InputError(f"data: {len(data)} usable rows, expected at least {SMALLEST_DATA}")
    offset = fit_offset(data.X, data.error).value
    Y = data.error if options.target == "error" else data.q_nominal + data.error
    groups: list[JointGroup] = []
    together: dict[tuple[str, ...], list[int]] = {}
    for joint, signals in enumerate(inputs.per_joint):
        together.setdefault(signals, []).append(joint)
    late = data.position >= _late_edge(data)
    for number, (signals, joints) in enumerate(together.items()):
        columns = inputs.features.columns_of(signals)
        X = np.ascontiguousarray(data.X[:, columns])
        report = part_of(progress, number, len(together))
        predictor = _fit_predictor(X, Y[:, joints], options, inputs.features, late, report)
        watched = columns[~inputs.features.bounded[columns]]
        groups.append(
            JointGroup(tuple(joints), columns, predictor, fit_valid_range(data.X[:, watched]), watched)
        )
        report(1.0)
    return CalibrationModel(
        kind=options.kind,
        preset=_preset(options),
        joint_names=data.joint_names,
        joint_units=data.joint_units,
        features=inputs.features,
        target=options.target,
        offset=offset,
        groups=tuple(groups),
        rate_hz=data.rate_hz,
    )


def _fit_predictor(
    X: Floats, Y: Floats, options: FitOptions, features: FeatureSet, late: np.ndarray, progress: Progress
) -> Predictor:
    memory = features.history > 0 or bool(features.play)
    if options.kind == "offset":
        return fit_offset(X, Y)
    if options.kind == "linear":
        ridge = MEMORY_RIDGE if features.play else 0.0
        return fit_linear(X, Y, ridge=ridge if options.ridge is None else options.ridge)
    if options.kind == "polynomial":
        ridge = MEMORY_RIDGE if memory else 0.0
        return fit_polynomial(X, Y, ridge=ridge if options.ridge is None else options.ridge)
    settings = BEST if options.preset == "best" else PAPER
    return fit_neural(X, Y, settings, seed=options.seed, late=late, progress=progress)


def _default_words(log: MotionLog) -> tuple[str, ...]:
    return ("q",) if log.tau is None else ("q", "tau")


def _late_edge(data: CalibrationData) -> float:
    """Where the last fifth of the training part of the recordings begins."""
    return 0.8 * float(data.position.max())


def _preset(options: FitOptions) -> str | None:
    return (options.preset or "paper") if options.kind == "neural" else None
