"""What the calibration paper claims of six hours of operation (II-G, III), and how each claim is decided.

What it claims of the polynomial and of the length of training is in six_hours_training.py.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from catenary.arrays import Floats
from papers.calibration import published
from papers.calibration.judging import CLEARLY, by_joint, less, less_lost
from papers.calibration.recordings import NETWORK
from papers.calibration.sessions import CONDITIONS, Condition
from papers.calibration.six_hours import LONGEST, OFFSET, measured
from papers.claims import by_count, graded, mean_and_spread
from papers.experiment import Claim, Judgement, Outcomes

LEARNT = ("linear", NETWORK)  # which the paper compares on every joint
COMPARED = (OFFSET, *LEARNT)
MOVED: tuple[Condition, ...] = ("unloaded", "loaded")
STEADY = 0.05  # [deg|mm] change in idle hours that is none: the paper's largest is 0.048
TWICE = 1.5  # loss under load over the loss without; the paper's are 1.8 (network), 2.2 (linear), 2.4 (fixed offset)
CLOSE = 0.25  # share of a published error within which ours reproduces it


def hourly(outcomes: Outcomes, condition: Condition, model: str, sets: Sequence[str] = LONGEST) -> Floats:
    """Return errors by robot, hour and joint, the mean over training sets; (0, 0, 3) without any."""
    found = measured(outcomes, condition, model, sets)
    averaged: Floats = found.mean(axis=1) if found.size else np.empty((0, 0, 3))
    return averaged


def losses(outcomes: Outcomes, condition: Condition, model: str) -> Floats:
    """Return by how much errors grow from hour 0 to hour 5, (robots, 3) [deg, deg, mm]."""
    errors = hourly(outcomes, condition, model)
    return errors[:, -1] - errors[:, 0]


def _told(outcomes: Outcomes, condition: Condition, models: Sequence[str] = COMPARED) -> str:
    return "; ".join(f"{model} {by_joint(losses(outcomes, condition, model))}" for model in models)


def _unloaded_loses(outcomes: Outcomes) -> Judgement:
    parts = []
    for model in COMPARED:
        errors = hourly(outcomes, "unloaded", model)
        parts += list(less(errors[:, 0], errors[:, -1]))
    return by_count(parts, "loss " + _told(outcomes, "unloaded"))


def _joint_1_loses_most(outcomes: Outcomes) -> Judgement:
    parts, told = [], []
    for condition in MOVED:
        for model in LEARNT:
            first, second = losses(outcomes, condition, model).T[:2]
            parts.append(less_lost(second, first))
            told.append(f"{condition}, {model} {mean_and_spread(first)} against {mean_and_spread(second)} deg")
    return by_count(parts, "; ".join(told))


def _idle_keeps(outcomes: Outcomes) -> Judgement:
    parts = [abs(loss) < STEADY for model in COMPARED for loss in losses(outcomes, "idle", model).mean(axis=0)]
    return by_count(parts, "change " + _told(outcomes, "idle"))


def _loaded_worse(outcomes: Outcomes) -> Judgement:
    parts = []
    for model in LEARNT:
        parts += list(less_lost(losses(outcomes, "unloaded", model), losses(outcomes, "loaded", model)))
    return by_count(parts, "; ".join(f"{condition}, {_told(outcomes, condition, LEARNT)}" for condition in MOVED))


def _loaded_twice_on_joint_1(outcomes: Outcomes) -> Judgement:
    ratios, more = {}, []
    for model in LEARNT:
        loaded, unloaded = (losses(outcomes, condition, model)[:, 0] for condition in ("loaded", "unloaded"))
        ratios[model] = loaded / unloaded
        more.append(less_lost(unloaded, loaded))
    told = ", ".join(f"{model} {mean_and_spread(ratio, 2)} times" for model, ratio in ratios.items())
    return graded(all(ratio.mean() >= TWICE for ratio in ratios.values()), all(more), told)


def _offset_loses_more_loaded(outcomes: Outcomes) -> Judgement:
    unloaded, loaded = (losses(outcomes, condition, OFFSET)[:, 0] for condition in MOVED)
    told = f"{mean_and_spread(unloaded)} unloaded, {mean_and_spread(loaded)} deg loaded"
    return graded(loaded.mean() >= TWICE * unloaded.mean(), less_lost(unloaded, loaded), told)


def _offset_loses_on_joint_1(outcomes: Outcomes) -> Judgement:
    parts, told = [], []
    for condition in MOVED:
        errors = hourly(outcomes, condition, OFFSET)
        grown = errors[:, -1] / errors[:, 0] - 1.0
        parts += [less_lost(grown[:, j], grown[:, 0]) for j in (1, 2)]
        told.append(f"{condition} {by_joint(100.0 * grown, digits=0, unit=' %')}")
    return by_count(parts, "; ".join(told))


def _within_loaded(outcomes: Outcomes) -> Judgement:
    errors = hourly(outcomes, "loaded", NETWORK)
    # to the digits that are published
    worst, limits = np.round(errors.mean(axis=0).max(axis=0), 3), published.SIX_HOURS["loaded"][NETWORK][1]
    return by_count(
        [value <= limit for value, limit in zip(worst, limits, strict=True)],
        f"greatest of six hours {by_joint(errors.max(axis=1))}",
    )


def _numbers(outcomes: Outcomes, condition: Condition) -> Judgement:
    parts, told = [], []
    for model in LEARNT:
        ends = hourly(outcomes, condition, model)[:, [0, -1]]
        wanted = np.array(published.SIX_HOURS[condition][model])
        parts += list((np.abs(ends.mean(axis=0) - wanted) <= CLOSE * wanted).ravel())
        told.append(f"{model} hours 0, 5 {by_joint(ends[:, 0], ends[:, 1])}")
    return by_count(parts, "; ".join(told))


def _published(condition: Condition, models: Sequence[str] = COMPARED) -> str:
    return "; ".join(
        f"{model} "
        + ", ".join(f"{a:.3f} to {b:.3f}" for a, b in zip(*published.SIX_HOURS[condition][model], strict=True))
        for model in models
    )


_LOAD = (
    "set of a cable grows with its tension, and the weight, beyond the remote centre, takes torque off joint 1 (the "
    "table of torques): wear by that cable's tension cannot make joint 1 lose more. The paper names fatigue of cables "
    "over small sheaves under load; which part carries the weight there, it does not say, and nothing here has it"
)
_NO_WEAR_BY_LOAD = "nothing here makes joint 1 wear by the load: under the weight its cable carries less"
_SAME_TABLE = (
    "the simulated robot's drift was fitted to the linear model of six inputs in hour 5 unloaded, and its other "
    "numbers to table I, with whose errors the paper's own hour 0 does not agree (0.247 and 0.186 deg on J2)"
)

CLAIMS = (
    Claim(
        "Six unloaded hours: fixed offset, linear model and network lose accuracy on every joint",
        "II-G",
        _published("unloaded"),
        f"error in hour 0 less than in hour 5, {CLEARLY}, for all three on all three joints, mean of the three longest "
        "training sets; same direction: for more than half",
        _unloaded_loses,
        why="on joints 2 and 3 what a fixed offset leaves is much larger than six hours of drift, so that the drift "
        "hardly shows in it",
        fitted=True,
    ),
    Claim(
        "Joint 1 loses more than joint 2, unloaded and loaded",
        "II-G, III",
        "network 0.411 against 0.099 deg unloaded, 0.741 against 0.181 loaded",
        f"joint 2's loss less, {CLEARLY}, for linear model and network in both conditions; same direction: in more "
        "than half of these",
        _joint_1_loses_most,
        fitted=True,
    ),
    Claim(
        "Six idle hours: no decay, but little on joint 1",
        "II-G",
        _published("idle"),
        f"hour 5 within {STEADY} deg or mm of hour 0 for fixed offset, linear model and network on every joint, mean "
        "over robots; same direction: more than half are",
        _idle_keeps,
        "the two tests of 20 minutes are two motions: fixed offsets tell how far they differ",
    ),
    Claim(
        "500 g make linear model and network lose more than no load does, on every joint",
        "II-G",
        "joint 1: 0.772 against 0.358 deg linear, 0.741 against 0.411 network",
        f"loss from hour 0 to hour 5 less without load, {CLEARLY}, for both models on all joints; same direction: for "
        "more than half",
        _loaded_worse,
        _LOAD,
    ),
    Claim(
        "Under 500 g joint 1 loses about twice as much",
        "II-G",
        "2.2 times (linear), 1.8 times (network)",
        f"at least {TWICE} times for both models; same direction: more, {CLEARLY}, for both",
        _loaded_twice_on_joint_1,
        _NO_WEAR_BY_LOAD,
    ),
    Claim(
        "Under 500 g joint 1's fixed offset loses more, too",
        "II-G",
        "0.121 deg unloaded, 0.296 deg loaded",
        f"at least {TWICE} times as much; same direction: more, {CLEARLY}",
        _offset_loses_more_loaded,
        _NO_WEAR_BY_LOAD,
    ),
    Claim(
        "Joint 1 is the only joint whose fixed offset loses with time and load",
        "III",
        f"unloaded {_published('unloaded', (OFFSET,))}; loaded {_published('loaded', (OFFSET,))}",
        f"from hour 0 to hour 5 the error of joints 2 and 3 grows by a smaller share than joint 1's, {CLEARLY}, "
        "unloaded and loaded; same direction: in more than half of the four. That joints 2 and 3 do not lose at all, "
        "the paper's own numbers do not say",
        _offset_loses_on_joint_1,
        fitted=True,
    ),
    Claim(
        "After enough training the network stays within 0.855 deg, 0.432 deg and 0.181 mm through six loaded hours",
        "I, II-G",
        "0.855, 0.432, 0.181",
        "largest of the hourly errors no larger on all three joints, mean over robots; same direction: on two",
        _within_loaded,
        why="on joint 3 the paper's network exceeds it in hour 0 already, as in table I",
    ),
    *(
        Claim(
            f"Numbers of hours 0 and 5, {condition}",
            "II-G",
            _published(condition, LEARNT),
            f"errors of linear model and network within {100.0 * CLOSE:.0f} % in both hours on all joints; same "
            "direction: more than half are",
            partial(_numbers, condition=condition),
            f"{_NO_WEAR_BY_LOAD}. For the rest, {_SAME_TABLE}" if condition == "loaded" else _SAME_TABLE,
            fitted=condition == "unloaded",
        )
        for condition in CONDITIONS
    ),
)
