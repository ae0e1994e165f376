"""What the calibration paper claims of six hours of operation (II-G), and how each claim is decided."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from catenary.arrays import Floats
from papers.calibration import published
from papers.calibration.recordings import JOINTS, NETWORK
from papers.calibration.sessions import CONDITIONS, Condition
from papers.calibration.six_hours import LONG, LONGEST, OFFSET, SHORT, measured
from papers.claims import NOT_MEASURED, by_count
from papers.experiment import Claim, Judgement, Outcomes

LEARNT = ("linear", NETWORK)  # which the paper compares on every joint
COMPARED = (OFFSET, *LEARNT)
STEADY = 0.05  # [deg|mm] change in idle hours that is none: the paper's largest is 0.048
DECAYS = 1.5  # error in hour 5 over hour 0 that is a significant decrease in accuracy: the paper's is 2.0
TWICE = 1.5  # loss under load over the loss without; the paper's are 1.8 (network) and 2.2 (linear)
CLOSE = 0.25  # share of a published error within which ours reproduces it


def hourly(outcomes: Outcomes, condition: Condition, model: str, sets: Sequence[str] = LONGEST) -> Floats:
    """Return errors by hour and joint, the mean over robots and training sets, (hours, 3); (0, 3) without any."""
    found = measured(outcomes, condition, model, sets)
    averaged: Floats = found.mean(axis=(0, 1)) if found.size else np.empty((0, 3))
    return averaged


def losses(outcomes: Outcomes, condition: Condition, model: str) -> Floats:
    """Return by how much each joint's error grows from hour 0 to hour 5, (3,) [deg, deg, mm]; empty without any."""
    errors = hourly(outcomes, condition, model)
    return errors[-1] - errors[0] if len(errors) else np.empty(0)


def _complete(outcomes: Outcomes, conditions: Sequence[Condition] = CONDITIONS) -> bool:
    return all(measured(outcomes, each, NETWORK, LONGEST).size for each in conditions)


def _told(outcomes: Outcomes, condition: Condition, models: Sequence[str] = COMPARED) -> str:
    return "; ".join(
        f"{model} " + ", ".join(f"{joint} {loss:+.3f}" for joint, loss in zip(JOINTS, found, strict=True))
        for model in models
        if len(found := losses(outcomes, condition, model))
    )


def _unloaded_loses(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("unloaded",)):
        return NOT_MEASURED
    parts = [loss > 0.0 for model in COMPARED for loss in losses(outcomes, "unloaded", model)]
    return by_count(parts, _told(outcomes, "unloaded"))


def _joint_1_loses_most(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("unloaded", "loaded")):
        return NOT_MEASURED
    parts, told = [], []
    for condition in ("unloaded", "loaded"):
        for model in LEARNT:
            first, second = losses(outcomes, condition, model)[:2]
            parts.append(first > second)
            told.append(f"{condition}, {model}: {first:+.3f} against {second:+.3f} deg")
    return by_count(parts, "; ".join(told))


def _idle_keeps(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("idle",)):
        return NOT_MEASURED
    parts = [abs(loss) < STEADY for model in COMPARED for loss in losses(outcomes, "idle", model)]
    return by_count(parts, _told(outcomes, "idle"))


def _idle_polynomial(outcomes: Outcomes) -> Judgement:
    errors = hourly(outcomes, "idle", "polynomial")
    if not len(errors):
        return NOT_MEASURED
    return by_count([errors[-1, 0] > DECAYS * errors[0, 0]], f"{errors[0, 0]:.3f} to {errors[-1, 0]:.3f} deg")


def _loaded_worse(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("unloaded", "loaded")):
        return NOT_MEASURED
    parts = [
        loaded > unloaded
        for model in LEARNT
        for loaded, unloaded in zip(
            losses(outcomes, "loaded", model), losses(outcomes, "unloaded", model), strict=True
        )
    ]
    told = f"loaded: {_told(outcomes, 'loaded', LEARNT)}; unloaded: {_told(outcomes, 'unloaded', LEARNT)}"
    return by_count(parts, told)


def _loaded_twice_on_joint_1(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("unloaded", "loaded")):
        return NOT_MEASURED
    ratios = {
        model: losses(outcomes, "loaded", model)[0] / losses(outcomes, "unloaded", model)[0]
        for model in LEARNT
    }
    told = ", ".join(f"{model} {ratio:.2f} times" for model, ratio in ratios.items())
    judged = by_count([ratio >= TWICE for ratio in ratios.values()], told)
    if judged.verdict == "not reproduced" and all(ratio > 1.0 for ratio in ratios.values()):
        return Judgement("same direction", told)
    return judged


def _longer_is_better(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes, ("unloaded", "loaded")):
        return NOT_MEASURED
    parts, told = [], []
    for condition in ("unloaded", "loaded"):
        for model in LEARNT:
            long, short = (hourly(outcomes, condition, model, sets)[-1] for sets in (LONG, SHORT))
            parts += list(long < short)
            pairs = ", ".join(f"{a:.3f}/{b:.3f}" for a, b in zip(long, short, strict=True))
            told.append(f"{condition}, {model} {pairs}")
    return by_count(parts, "long/short in hour 5: " + "; ".join(told))


def _within_loaded(outcomes: Outcomes) -> Judgement:
    errors = hourly(outcomes, "loaded", NETWORK)
    if not len(errors):
        return NOT_MEASURED
    # to the digits that are published
    worst, limits = np.round(errors.max(axis=0), 3), published.SIX_HOURS["loaded"]["network"][1]
    told = ", ".join(f"{joint} {value:.3f}" for joint, value in zip(JOINTS, worst, strict=True))
    return by_count([value <= limit for value, limit in zip(worst, limits, strict=True)], told)


def _numbers(outcomes: Outcomes, condition: Condition) -> Judgement:
    if not _complete(outcomes, (condition,)):
        return NOT_MEASURED
    parts, told = [], []
    for model in LEARNT:
        errors = hourly(outcomes, condition, model)[[0, -1]]
        wanted = np.array(published.SIX_HOURS[condition][model])
        parts += list((np.abs(errors - wanted) <= CLOSE * wanted).ravel())
        pairs = ", ".join(f"{a:.3f} to {b:.3f}" for a, b in errors.T)
        told.append(f"{model} {pairs}")
    return by_count(parts, "; ".join(told))


def _published(condition: Condition) -> str:
    return "; ".join(
        f"{model} " + ", ".join(f"{a:.3f} to {b:.3f}" for a, b in zip(*pair, strict=True))
        for model, pair in published.SIX_HOURS[condition].items()
    )


_LOAD = (
    "set of a cable grows with its tension, and the weight, beyond the remote centre, takes torque off joint 1 (the "
    "table of torques): wear by that cable's tension cannot make joint 1 lose more. The paper names fatigue of cables "
    "over small sheaves under load; which part carries the weight there, it does not say, and nothing here has it"
)
_IDLE = (
    "nothing in the simulated robot changes on its brakes but the slow branch of its cables, within a minute"
)
_SAME_TABLE = (
    "the simulated robot's drift was fitted to the linear model of six inputs in hour 5 unloaded, and its other "
    "numbers to table I, with whose errors the paper's own hour 0 does not agree (0.247 and 0.186 deg on J2)"
)

CLAIMS = (
    Claim(
        "Six unloaded hours: fixed offset, linear model and network lose accuracy on every joint",
        "II-G",
        _published("unloaded"),
        "error in hour 5 above hour 0 for all three on all three joints, mean over robots and the three longest "
        "training sets; same direction: for more than half",
        _unloaded_loses,
    ),
    Claim(
        "Joint 1 loses more than joint 2, unloaded and loaded",
        "II-G, III",
        "network 0.411 against 0.099 deg unloaded, 0.741 against 0.181 loaded",
        "for linear model and network in both conditions; same direction: in more than half of these",
        _joint_1_loses_most,
    ),
    Claim(
        "Six idle hours: no decay, but little on joint 1",
        "II-G",
        _published("idle"),
        f"hour 5 within {STEADY} deg or mm of hour 0 for fixed offset, linear model and network on every joint",
        _idle_keeps,
        "the two tests of 20 minutes are two motions: fixed offsets tell how far they differ",
    ),
    Claim(
        "Idle hours alone ruin the polynomial on joint 1",
        "II-G",
        "0.241 to 0.493 deg",
        f"error in hour 5 at least {DECAYS} times that in hour 0",
        _idle_polynomial,
        _IDLE + ", so that the polynomial meets the states on which it was trained",
    ),
    Claim(
        "500 g make linear model and network lose more than no load does, on every joint",
        "II-G",
        "joint 1: 0.772 against 0.358 deg linear, 0.741 against 0.411 network",
        "loss from hour 0 to hour 5 larger under load for both models on all joints; same direction: for more "
        "than half",
        _loaded_worse,
        _LOAD,
    ),
    Claim(
        "Under 500 g joint 1 loses about twice as much",
        "II-G",
        "2.2 times (linear), 1.8 times (network)",
        f"at least {TWICE} times for both models; same direction: more than once",
        _loaded_twice_on_joint_1,
        _LOAD,
    ),
    Claim(
        "Longer training is better in hour 5",
        "II-G, figure 6",
        "in many entries, especially for regressions; no numbers",
        "mean of training sets over 800 s below the mean of those under 500 s, for linear model and network on every "
        "joint, unloaded and loaded; same direction: in more than half",
        _longer_is_better,
        "joint 1's error of hour 5 is drift, which no training before it has seen",
    ),
    Claim(
        "After enough training the network stays within 0.855 deg, 0.432 deg and 0.181 mm through six loaded hours",
        "I, II-G",
        "0.855, 0.432, 0.181",
        "largest of the hourly errors no larger on all three joints; same direction: on two",
        _within_loaded,
    ),
    *(
        Claim(
            f"Numbers of hours 0 and 5, {condition}",
            "II-G",
            _published(condition),
            f"errors of linear model and network within {100.0 * CLOSE:.0f} % in both hours on all joints; same "
            "direction: more than half are",
            partial(_numbers, condition=condition),
            _SAME_TABLE,
        )
        for condition in CONDITIONS
    ),
)
