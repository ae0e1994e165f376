"""Which kind of model for which joint: chosen on data that the model did not see, the simplest that will do.

Of the kinds in their order, from the simplest, a joint gets the first whose error is within one standard error of the
best kind's [the one-standard-error rule; Breiman et al. 1984, section 3.4.3] and within `CLOSE_RATIO` of it. The errors
are those of the cross-validation, over recordings where there are several, as motions and days differ more than blocks
of one do; else over contiguous blocks of time. Polynomials are not among the kinds: blocks of a zig-zag do not show how
their error grows with the square of the distance from it; on random motion of simulated arms they were never the best.
The standard error is that of the difference between two kinds' squared errors on the same rows, over the blocks of time
that intervals are estimated from. A joint's part of the model of its kind is its part of the chosen model, to the bit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.calibration.conformal import time_blocks
from catenary.calibration.evaluate import CrossValidation
from catenary.calibration.features import FeatureSet
from catenary.calibration.model import CalibrationModel, JointGroup
from catenary.calibration.model_kinds import AUTO
from catenary.errors import InputError

CLOSE_RATIO = 1.03  # times the best kind's error
_BLOCKS_LEVEL = 0.9  # the blocks of time are those of intervals that hold this share: fifty, where rows suffice


@dataclass(frozen=True)
class JointChoice:
    """What was chosen for a joint, and the errors that it was chosen by, in deg or mm."""

    joint: str
    unit: str
    chosen: str
    errors: Mapping[str, float]  # of every kind that was tried, the simplest first

    def __str__(self) -> str:
        """Return the choice in one sentence."""
        others = ", ".join(f"{name} {error:.3g}" for name, error in self.errors.items() if name != self.chosen)
        error = f"{self.errors[self.chosen]:.3g} {self.unit} on parts of its training left out"
        return f"{self.joint}: {self.chosen}, {error}; {others}"


def choose(validations: Mapping[str, CrossValidation]) -> tuple[JointChoice, ...]:
    """Choose a kind for every joint by its errors on data that models of the kind did not see."""
    first, *others = validations.values()
    if any(not np.array_equal(each.recording, first.recording) for each in others):
        raise InputError("model auto: the kinds' inputs leave different rows; give one of them")
    squares = {name: block_squares(each.after_model, each.recording) for name, each in validations.items()}
    choices = []
    for j, joint in enumerate(first.spread):
        errors = {name: each.spread[j].rmse_mean for name, each in validations.items()}
        best = min(errors, key=lambda name: errors[name])
        chosen = next(
            name
            for name, error in errors.items()
            if error <= CLOSE_RATIO * errors[best]
            and (excess := squares[name][:, j] - squares[best][:, j]).mean() <= excess.std(ddof=1) / len(excess) ** 0.5
        )
        choices.append(JointChoice(joint.joint, joint.unit, chosen, errors))
    return tuple(choices)


def block_squares(errors: Floats, recording: Integers) -> Floats:
    """Return mean squares of errors (N, n) over K blocks of time of the recordings (N,), (K, n)."""
    block = time_blocks(recording, level=_BLOCKS_LEVEL)
    return np.array([np.square(errors[block == k]).mean(axis=0) for k in np.unique(block)])


def joined(validations: Mapping[str, CrossValidation], choices: Sequence[JointChoice]) -> CrossValidation:
    """Return the cross-validation of the chosen model: each joint's from its kind."""
    of_joints = [validations[choice.chosen] for choice in choices]
    parts = {
        name: np.column_stack([getattr(each, name)[:, j] for j, each in enumerate(of_joints)])
        for name in ("after_offset", "after_model", "inside")
    }
    spread = tuple(each.spread[j] for j, each in enumerate(of_joints))
    return CrossValidation(spread, **parts, recording=of_joints[0].recording)


def composed(models: Mapping[str, CalibrationModel], choices: Sequence[JointChoice]) -> CalibrationModel:
    """Return a model that gives each joint what the model of its chosen kind gives it."""
    taken = {choice.chosen: models[choice.chosen] for choice in choices}
    first = next(iter(taken.values()))
    if any(model.joint_names != first.joint_names for model in taken.values()):
        raise InputError("model auto: expected models of the same joints")
    features = _union([model.features for model in taken.values()])
    groups = []
    for name, model in taken.items():
        own = {j for j, choice in enumerate(choices) if choice.chosen == name}
        place = np.array([features.names.index(each) for each in model.features.names], dtype=np.int64)
        for group in model.groups:
            outputs = [k for k, joint in enumerate(group.joints) if joint in own]
            if outputs:
                joints = tuple(group.joints[k] for k in outputs)
                columns, watched = place[group.columns], place[group.watched]
                groups.append(JointGroup(joints, columns, group.predictor.of(outputs), group.valid_range, watched))
    largest = np.array([taken[choice.chosen].largest[j] for j, choice in enumerate(choices)])
    largest = np.maximum(largest, np.abs(first.offset))
    return replace(first, kind=AUTO, preset=None, features=features, largest=largest, groups=tuple(groups))


def _union(sets: Sequence[FeatureSet]) -> FeatureSet:
    """Return the features of all sets."""
    units = {name: unit for each in sets for name, unit in zip(each.signals, each.units, strict=True)}
    periods = [each.period for each in sets if each.steps]
    return FeatureSet(
        tuple(units),
        tuple(units.values()),
        tuple(dict.fromkeys(play for each in sets for play in each.play)),
        tuple(dict.fromkeys(midline for each in sets for midline in each.midlines)),
        next((each.friction for each in sets if each.friction is not None), None),
        tuple(dict.fromkeys(step for each in sets for step in each.steps)),
        periods[0] if periods else None,
    )
