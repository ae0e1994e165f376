"""Which kind of model for which joint: chosen on blocks of time that the model did not see, the simplest that will do.

Of the kinds in their order, from the simplest, a joint gets the first whose error is within one standard error of the
best kind's [the one-standard-error rule; Breiman et al. 1984, section 3.4.3] and within `CLOSE` of it. The errors are
those of the cross-validation over contiguous blocks of the training data; what is held out is not looked at. The
joint's part of the model of that kind, fitted to all training data, becomes its part of the chosen model, to the bit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.calibration.evaluate import CrossValidation, Spread
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit import FitOptions
from catenary.calibration.model import CalibrationModel, JointGroup
from catenary.errors import InputError

SIMPLEST_FIRST = ("offset", "linear", "polynomial", "neural")
CLOSE = 1.03  # times the best kind's error
ROWS_PER_TERM = 10  # below which a polynomial is not tried: it would follow the noise, and take long


@dataclass(frozen=True)
class JointChoice:
    """What was chosen for a joint, and the errors that it was chosen by, in deg or mm."""

    joint: str
    unit: str
    chosen: str
    errors: Mapping[str, float]  # of every kind that was tried, the simplest first

    def __str__(self) -> str:
        """Return the choice in one sentence."""
        others = ", ".join(
            f"{name} {error:.3g}" for name, error in self.errors.items() if name != self.chosen
        )
        error = f"{self.errors[self.chosen]:.3g} {self.unit} on blocks of time that it did not see"
        return f"{self.joint}: {self.chosen}, {error}; {others}"


def tried(options: FitOptions, features: int, rows: int) -> dict[str, FitOptions]:
    """Return the options of every kind that is tried, the simplest first.

    Args:
        options: What was asked for; its kind is "auto".
        features: How many a polynomial would take.
        rows: Of the training data.
    """
    found = {}
    for kind in SIMPLEST_FIRST:
        if kind == "polynomial" and rows < ROWS_PER_TERM * (features + 1) * (features + 2) // 2:
            continue
        found[kind] = options.of_kind(kind)  # type: ignore[arg-type]
    return found


def choose(spreads: Mapping[str, Sequence[Spread]]) -> tuple[JointChoice, ...]:
    """Choose a kind for every joint by its errors over blocks of time.

    Args:
        spreads: Of every kind, the simplest first: a spread per joint.
    """
    choices = []
    for of_kinds in zip(*spreads.values(), strict=True):
        errors = {name: spread.rmse_mean for name, spread in zip(spreads, of_kinds, strict=True)}
        best = min(of_kinds, key=lambda spread: spread.rmse_mean)
        bound = best.rmse_mean + min(best.rmse_sd / np.sqrt(best.folds), (CLOSE - 1.0) * best.rmse_mean)
        chosen = next(name for name, error in errors.items() if error <= bound)
        choices.append(JointChoice(best.joint, best.unit, chosen, errors))
    return tuple(choices)


def joined(validations: Mapping[str, CrossValidation], choices: Sequence[JointChoice]) -> CrossValidation:
    """Return the cross-validation of the chosen model: each joint's from its kind.

    Raises:
        InputError: The kinds were tried on different rows.
    """
    of_joints = [validations[choice.chosen] for choice in choices]
    if len({len(each.recording) for each in of_joints}) != 1:
        raise InputError("model auto: the kinds' inputs leave different rows; give one of them")
    parts = {
        name: np.column_stack([getattr(each, name)[:, j] for j, each in enumerate(of_joints)])
        for name in ("after_offset", "after_model", "inside")
    }
    spread = tuple(each.spread[j] for j, each in enumerate(of_joints))
    return CrossValidation(spread, **parts, recording=of_joints[0].recording)


def composed(models: Mapping[str, CalibrationModel], choices: Sequence[JointChoice]) -> CalibrationModel:
    """Return a model that gives each joint what the model of its chosen kind gives it.

    Raises:
        InputError: The models are of different joints, or learn different targets.
    """
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
                groups.append(
                    JointGroup(
                        tuple(group.joints[k] for k in outputs),
                        place[group.columns],
                        group.predictor.of(outputs),
                        group.valid_range,
                        place[group.watched],
                    )
                )
    began = [taken[choice.chosen].priors[j : j + 1] for j, choice in enumerate(choices)]
    priors = tuple(each[0] if each else None for each in began)
    return replace(
        first,
        kind="auto",
        preset=None,
        features=features,
        groups=tuple(groups),
        priors=priors if any(priors) else (),
    )


def _union(sets: Sequence[FeatureSet]) -> FeatureSet:
    """Return the features of all sets, whose history is the same."""
    units = {name: unit for each in sets for name, unit in zip(each.signals, each.units, strict=True)}
    periods = [each.period for each in sets if each.steps]
    return FeatureSet(
        tuple(units),
        tuple(units.values()),
        max(each.history for each in sets),
        tuple(dict.fromkeys(play for each in sets for play in each.play)),
        tuple(dict.fromkeys(step for each in sets for step in each.steps)),
        periods[0] if periods else None,
    )
