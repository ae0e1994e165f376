"""Figure 6 of the calibration paper: six hours idle, unloaded and with 500 g, after zig-zags of every sparsity.

Eleven training sets, of 1/2 to 1/6 and their combinations, on each robot and in each condition; every model is tested
in every hour. The paper's numbers are means over the three longest sets; so are ours. Conditions, what was chosen where
the paper is silent, and what the simulated robot lacks for the loaded hours: papers/calibration/six_hours.py.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from papers.calibration import published, six_hours
from papers.calibration.judging import (
    BY_ONE_SESSION,
    CONSIDERABLE,
    by_joint,
    by_one_session,
    changes,
    less,
    less_lost,
    statement,
)
from papers.calibration.published import SIX_HOURS_POLYNOMIAL_J1
from papers.calibration.recordings import LEARNER, NETWORK, draws, homed, random_log
from papers.calibration.six_hours import CONDITIONS, HOURS, LONG, LONGEST, OFFSET, SHORT, SHORTEST, Condition, measured
from papers.experiment import CLEARLY, NOMINAL, Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import METHOD_COLORS, log_scale, panels
from papers.kit import IN_UNITS, Missing, as_text, by_count, by_robot, filled, graded, grid, joint_tables, rows, table
from papers.plant.targets import fitted_to

SHOWN = (OFFSET, "linear", "polynomial", NETWORK, LEARNER)
TRAINED = {"3 longest": LONGEST, "3 shortest": SHORTEST}
LEARNT = ("linear", NETWORK)  # which the paper compares on every joint
COMPARED = (OFFSET, *LEARNT)
MOVED: tuple[Condition, ...] = ("unloaded", "loaded")
STEADY = 0.05  # [deg|mm] change in idle hours that is none: the paper's largest is 0.048
TWICE = 1.5  # loss under load over the loss without; the paper's are 1.8 (network), 2.2 (linear), 2.4 (fixed offset)
CLOSE = 0.25  # share of a published error within which ours reproduces it
_NO_WEAR_BY_LOAD = "nothing here makes joint 1 wear by the load: under the weight its cable carries less"
_SAME_TABLE = (
    "how far the simulated robot's cables wander was chosen by the linear model in hour 5 unloaded, its other numbers "
    "fitted to means of table I and the three hours 0. The fit misses them on joint 2, where its linear model is better"
)
POLYNOMIAL = "polynomial"
REGRESSIONS = ("linear", POLYNOMIAL)
DECAYS = 1.5  # error in hour 5 over hour 0 that is a significant decrease in accuracy: the paper's is 2.0
WIDE = 0.2  # [deg|mm] the height of a box that the paper marks with an arrow
MANY = 0.5  # of the regressions' entries
LATE = (3, 4, 5)  # after hour 3
_DRIFT = "hour 5's error is mostly drift, which no training before it has seen"


@run(revision=1)
def torques(seed: int | None, payload: float, seconds: float) -> Result:
    """Return the root mean square of the torques that drive J1 [Nm], J2 [Nm] and J3 [N] in random motion."""
    log = random_log(homed(seed, payload=payload), draws(seed, 40), seconds)
    return {"rms": [float(value) for value in np.sqrt(np.mean(np.asarray(log.tau) ** 2, axis=0))]}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, condition and group of training sets, and torques of the nominal robot."""
    seconds = 30.0 if scope.quick else six_hours.HOUR / 3.0
    return [
        *six_hours.cases_of(scope),
        *grid(torques, {"payload": (0.0, six_hours.PAYLOAD)}, seed=NOMINAL, seconds=seconds),
    ]


def report(o: Outcomes) -> Report:
    """Return errors of the first and the last hour by joint, of every hour, and the paper's picture."""
    driving = [
        [f"{args['payload'] * 1e3:.0f} g", *(f"{value:.3f}" for value in result["rms"])]
        for args, result in o.items(torques)
    ]
    header = "condition, model | hour 0 | paper | hour 5 | paper | hour 5, guarded"
    every = ["condition, model", "training", *(f"hour {hour}" for hour in range(6))]
    title = "{}, RMSE in every hour, after the three longest and the three shortest training sets"
    tables = [
        *joint_tables("{}, RMSE in hours 0 and 5", header, lambda j: _ends(o, j)),
        table(
            "Torque that drives the nominal robot, RMS in random motion",
            "payload | J1 [Nm] | J2 [Nm] | J3 [N]",
            driving,
        ),
        *joint_tables(title, every, lambda j: _every_hour(o, j)),
    ]
    caption = (
        "RMSE by hour; boxes are training sets, each the mean over robots; an arrow where sets over 800 s are 20 % "
        "better than those under 500 s and the box is higher than 0.2. Lines join medians"
    )
    return Report(filled(tables), {caption: _picture(o)})


def _ends(o: Outcomes, j: int) -> list[list[str]]:
    def row(condition: Condition, model: str) -> list[str]:
        errors = measured(o, condition, model, LONGEST)
        errors = errors if errors.size else measured(o, condition, model)
        if not errors.size:
            raise Missing(model)
        guarded = measured(o, condition, model, LONGEST, kind="guarded")
        first, last = paper_numbers(condition, model, j)
        ends = [_over_robots(errors[:, :, hour, j]) for hour in (0, -1)]
        end = _over_robots(guarded[:, :, -1, j]) if guarded.size else "-"
        return [f"{condition}, {model}", ends[0], first, ends[1], last, end]

    return rows(row, CONDITIONS, SHOWN)


def _every_hour(o: Outcomes, j: int) -> list[list[str]]:
    """Return a joint's errors by condition, model and training, a column for each hour; idle hours are two."""

    def row(condition: Condition, model: str, sets: str) -> list[str]:
        errors = measured(o, condition, model, TRAINED[sets])
        if not errors.size:
            raise Missing(model)
        by_hour = {hour: _over_robots(errors[:, :, k, j]) for k, hour in enumerate(HOURS[condition])}
        return [f"{condition}, {model}", sets, *(by_hour.get(hour, "-") for hour in range(6))]

    return rows(row, CONDITIONS, SHOWN, TRAINED)


def paper_numbers(condition: Condition, model: str, j: int) -> tuple[str, str]:
    """Return the paper's errors of a joint in hours 0 and 5, as text."""
    if model in published.SIX_HOURS[condition]:
        first, last = (each[j] for each in published.SIX_HOURS[condition][model])
    elif model == "polynomial" and j == 0:
        first, last = published.SIX_HOURS_POLYNOMIAL_J1[condition]
    else:
        return "-", "-"
    return f"{first:.3f}", f"{last:.3f}"


def _over_robots(values: Floats) -> str:
    """Return mean and spread over robots of the mean over training sets, (robots, sets)."""
    return f"{by_robot(values.mean(axis=1))}"


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 8.0, rows=3, sharex=True, sharey="row")
    for place, panel in enumerate(axes):
        j, condition = place // 3, CONDITIONS[place % 3]
        for k, model in enumerate(SHOWN):
            errors = measured(o, condition, model)
            if not errors.size:
                continue
            boxes = errors[..., j].mean(axis=0)  # (sets, hours)
            at = np.array(HOURS[condition]) + (k - (len(SHOWN) - 1) / 2.0) * 0.17
            _boxes(panel, boxes, at, model)
            panel.plot(at, np.median(boxes, axis=0), color=METHOD_COLORS[model], linewidth=1.0)
            _mark(panel, considerably_better(o, condition, model), boxes, j, at)
        log_scale(panel)  # on a linear scale the boxes of good models are a few pixels high
        panel.set_xticks(range(6))
        panel.tick_params(labelbottom=True)
        if j == 0:
            panel.set_title({"loaded": "500 g"}.get(condition, condition), fontsize=10)
        if place % 3 == 0:
            panel.set_ylabel(IN_UNITS[j])
        if j == 2:
            panel.set_xlabel("hour")
    handles = [panel.plot([], [], color=METHOD_COLORS[model], linewidth=4)[0] for model in SHOWN]
    figure.legend(handles, SHOWN, loc="outside lower center", ncols=len(SHOWN), frameon=False, fontsize=9)
    return figure


def _boxes(panel: Any, boxes: Floats, at: Floats, model: str) -> None:
    color = METHOD_COLORS[model]
    panel.boxplot(
        boxes, positions=at, widths=0.14, patch_artist=True, manage_ticks=False,
        boxprops={"facecolor": color, "edgecolor": color, "alpha": 0.6},
        medianprops={"color": "black", "linewidth": 0.8},
        whiskerprops={"color": color, "linewidth": 0.8},
        capprops={"color": color, "linewidth": 0.8},
        flierprops={"marker": ".", "markersize": 3, "markeredgecolor": color},
    )  # fmt: skip


def _mark(panel: Any, better: NDArray[np.bool_], boxes: Floats, j: int, at: Floats) -> None:
    """Mark hours in which long training is considerably better, as the paper does."""
    if len(better):
        height = np.quantile(boxes, 0.75, axis=0) - np.quantile(boxes, 0.25, axis=0)
        marked = better[:, j] & (height > WIDE)
        panel.plot(at[marked], boxes[-len(LONG) :].mean(axis=0)[marked], "v", color="black", markersize=4)


def hourly(o: Outcomes, condition: Condition, model: str, sets: Sequence[str] = LONGEST) -> Floats:
    """Return errors by robot, hour and joint, the mean over training sets."""
    errors = measured(o, condition, model, sets)
    if not errors.size:
        raise Missing(f"{condition} {model}")
    return by_robot(errors.mean(axis=1))


def losses(o: Outcomes, condition: Condition, model: str) -> Floats:
    """Return by how much errors grow from hour 0 to hour 5, (robots, 3) [deg, deg, mm]."""
    errors = hourly(o, condition, model)
    return errors[:, -1] - errors[:, 0]


def _losses(o: Outcomes, condition: Condition, models: Sequence[str] = COMPARED) -> str:
    return as_text({model: losses(o, condition, model) for model in models}, between="; ")


def _published(condition: Condition, models: Sequence[str] = COMPARED) -> str:
    return "; ".join(
        f"{model} "
        + ", ".join(f"{a:.3f} to {b:.3f}" for a, b in zip(*published.SIX_HOURS[condition][model], strict=True))
        for model in models
    )


EXPERIMENT = Experiment(
    "calibration-figure-6", "figure 6", "Six hours idle, unloaded and loaded", __doc__,
    cases, report, minutes=36.0, drawn=six_hours.DRAWN,
)  # fmt: skip


@EXPERIMENT.claim(
    "Six unloaded hours: fixed offset, linear model and network lose accuracy on every joint",
    "II-G",
    _published("unloaded"),
    f"error in hour 0 less than in hour 5, {CLEARLY}, for all three on all three joints, mean of the three longest "
    "training sets; same direction: for more than half",
    "on joints 2 and 3 what a fixed offset leaves is much larger than six hours of drift, so that the drift hardly "
    "shows in it; and on joint 1 six hours differ between robots by as much as they cost",
    fitted=fitted_to("linear", "hour 0, unloaded"),
)
def _unloaded_loses(o: Outcomes) -> Judgement:
    every = [hourly(o, "unloaded", model) for model in COMPARED]
    parts = [each for errors in every for each in less(errors[:, 0], errors[:, -1])]
    return by_count(parts, f"loss {_losses(o, 'unloaded')}")


@EXPERIMENT.claim(
    "Joint 1 loses more than joint 2, unloaded and loaded",
    "II-G, III",
    "network 0.411 against 0.099 deg unloaded, 0.741 against 0.181 loaded",
    f"joint 1's loss larger, mean of linear model and network, in both conditions: {BY_ONE_SESSION}",
    fitted=fitted_to("linear", "hour 5, unloaded"),
)
def _joint_1_loses_most(o: Outcomes) -> Judgement:
    lost = {f"{each}, {model}": losses(o, each, model).T[:2] for each in MOVED for model in LEARNT}
    text = "; ".join(f"{name} {first} against {second} deg" for name, (first, second) in lost.items())
    both = [np.mean([losses(o, each, model) for model in LEARNT], axis=0) for each in MOVED]
    return by_one_session([loss[:, 0] - loss[:, 1] for loss in both], text)


@EXPERIMENT.claim(
    "Six idle hours: no decay, but little on joint 1",
    "II-G",
    _published("idle"),
    f"hour 5 within {STEADY} deg or mm of hour 0 for fixed offset, linear model and network on every joint, mean over "
    "robots; same direction: more than half are",
    "the two tests of 20 minutes are two motions: fixed offsets tell how far they differ",
)
def _idle_keeps(o: Outcomes) -> Judgement:
    parts = [abs(loss) < STEADY for model in COMPARED for loss in losses(o, "idle", model).mean(axis=0)]
    return by_count(parts, f"change {_losses(o, 'idle')}")


@EXPERIMENT.claim(
    "500 g make linear model and network lose more than no load does, on every joint",
    "II-G",
    "joint 1: 0.772 against 0.358 deg linear, 0.741 against 0.411 network",
    f"loss from hour 0 to hour 5 larger, mean of both models, on all joints: {BY_ONE_SESSION}",
    "set of a cable grows with its tension, and the weight, beyond the remote centre, takes torque off joint 1 (the "
    "table of torques): wear by that cable's tension cannot make joint 1 lose more. The paper names fatigue of cables "
    "over small sheaves under load; which part carries the weight there, it does not say, and nothing here has it",
)
def _loaded_worse(o: Outcomes) -> Judgement:
    unloaded, loaded = (np.mean([losses(o, each, model) for model in LEARNT], axis=0) for each in MOVED)
    text = "; ".join(f"{condition}, {_losses(o, condition, LEARNT)}" for condition in MOVED)
    return by_one_session((loaded - unloaded).T, text)


@EXPERIMENT.claim(
    "Under 500 g joint 1 loses about twice as much",
    "II-G",
    "2.2 times (linear), 1.8 times (network)",
    f"at least {TWICE} times, mean of both models: {BY_ONE_SESSION}",
    _NO_WEAR_BY_LOAD,
)
def _loaded_twice_on_joint_1(o: Outcomes) -> Judgement:
    lost = {model: [losses(o, condition, model)[:, 0] for condition in MOVED] for model in LEARNT}
    ratios = {model: loaded / unloaded for model, (unloaded, loaded) in lost.items()}
    unloaded, loaded = np.mean([*lost.values()], axis=0)
    return by_one_session([loaded - TWICE * unloaded], as_text(ratios, ".2f", " times"))


@EXPERIMENT.claim(
    "Under 500 g joint 1's fixed offset loses more, too",
    "II-G",
    "0.121 deg unloaded, 0.296 deg loaded",
    f"at least {TWICE} times as much: {BY_ONE_SESSION}",
    _NO_WEAR_BY_LOAD,
)
def _offset_loses_more_loaded(o: Outcomes) -> Judgement:
    unloaded, loaded = (losses(o, condition, OFFSET)[:, 0] for condition in MOVED)
    return by_one_session([loaded - TWICE * unloaded], f"{unloaded} unloaded, {loaded} deg loaded")


@EXPERIMENT.claim(
    "Joint 1 is the only joint whose fixed offset loses with time and load",
    "III",
    f"unloaded {_published('unloaded', (OFFSET,))}; loaded {_published('loaded', (OFFSET,))}",
    "from hour 0 to hour 5 the error of joints 2 and 3 grows by a smaller share than joint 1's, unloaded and loaded: "
    f"{BY_ONE_SESSION}. That joints 2 and 3 do not lose at all, the paper's own numbers do not say",
    fitted=fitted_to("fixed offset", "hour 0, unloaded"),
)
def _offset_loses_on_joint_1(o: Outcomes) -> Judgement:
    sessions, texts = [], []
    for condition in MOVED:
        errors = hourly(o, condition, OFFSET)
        grown = errors[:, -1] / errors[:, 0] - 1.0
        sessions.append(grown[:, 0] - grown[:, 1:].max(axis=1))
        texts.append(f"{condition} {by_joint(100.0 * grown, digits=0, unit=' %')}")
    return by_one_session(sessions, "; ".join(texts))


@EXPERIMENT.claim(
    "After enough training the network stays within 0.855 deg, 0.432 deg and 0.181 mm through six loaded hours",
    "I, II-G",
    "0.855, 0.432, 0.181",
    "largest of the hourly errors no larger on all three joints, mean over robots; same direction: on two",
)
def _within_loaded(o: Outcomes) -> Judgement:
    errors = hourly(o, "loaded", NETWORK)
    # to the digits that are published
    worst, limits = np.round(errors.mean(axis=0).max(axis=0), 3), published.SIX_HOURS["loaded"][NETWORK][1]
    return by_count(worst <= np.array(limits), f"greatest of six hours {errors.max(axis=1)}")


def _numbers(o: Outcomes, condition: Condition) -> Judgement:
    parts, texts = [], []
    for model in LEARNT:
        ends = hourly(o, condition, model)[:, [0, -1]]
        paper = np.array(published.SIX_HOURS[condition][model])
        parts += list((np.abs(ends.mean(axis=0) - paper) <= CLOSE * paper).ravel())
        texts.append(f"{model} hours 0, 5 {by_joint(ends[:, 0], ends[:, 1])}")
    return by_count(parts, "; ".join(texts))


for each in CONDITIONS:
    EXPERIMENT.claim(
        f"Numbers of hours 0 and 5, {each}",
        "II-G",
        _published(each, LEARNT),
        f"errors of linear model and network within {100.0 * CLOSE:.0f} % in both hours on all joints; same direction: "
        "more than half are",
        f"{_NO_WEAR_BY_LOAD}. For the rest, {_SAME_TABLE}" if each == "loaded" else _SAME_TABLE,
        fitted=fitted_to("linear", f"hour 0, {each}"),
    )(partial(_numbers, condition=each))


def considerably_better(o: Outcomes, condition: Condition, model: str) -> NDArray[np.bool_]:
    """Say by hour and joint whether, on average, sets over 800 s are more than 20 % better than those under 500 s."""
    short, long = (measured(o, condition, model, sets) for sets in (SHORT, LONG))
    if not short.size or not long.size or short.shape[1] + long.shape[1] < len(SHORT) + len(LONG):
        return np.empty((0, 3), dtype=bool)
    better: NDArray[np.bool_] = long.mean(axis=(0, 1)) < (1.0 - CONSIDERABLE) * short.mean(axis=(0, 1))
    return better


@EXPERIMENT.claim(
    "Idle hours alone ruin the polynomial on joint 1",
    "II-G",
    "0.241 to 0.493 deg",
    f"error in hour 5 at least {DECAYS} times that in hour 0, mean over robots",
    "after the hours on the brakes the tool stands elsewhere than in training, which the polynomial takes for more "
    "than it is worth, unlike network and linear model: with the tool's inputs moved back, the drawn robots err as in "
    "hour 0. Nothing else changes but the slow branch of the cables, within a minute",
)
def _idle_polynomial(o: Outcomes) -> Judgement:
    errors = hourly(o, "idle", POLYNOMIAL)
    first, last = errors[:, 0, 0], errors[:, -1, 0]
    text = f"{first} to {last} deg"
    return by_count([last.mean() > DECAYS * first.mean()], text)


@EXPERIMENT.claim(
    "Six hours of motion ruin the polynomial on joint 1",
    "II-G",
    "0.235 to 1.529 deg unloaded, 0.221 to 1.045 deg loaded",
    f"error in hour 5 at least {1.0 - CLOSE} times the published one, unloaded and loaded, mean over robots; same "
    f"direction: it loses more than the linear model in both, {CLEARLY}",
    "it loses about what the linear model loses, the drift of the cables: wear changes the simulated robot's errors "
    "and hardly its inputs, and while the arm moves its tool stands where it stood in training",
)
def _moved_polynomial(o: Outcomes) -> Judgement:
    close, more, texts = [], [], []
    for condition in MOVED:
        errors = hourly(o, condition, POLYNOMIAL)[:, [0, -1], 0]
        close.append(errors[:, 1].mean() >= (1.0 - CLOSE) * SIX_HOURS_POLYNOMIAL_J1[condition][1])
        loss, linear = (losses(o, condition, model)[:, 0] for model in (POLYNOMIAL, "linear"))
        more.append(less_lost(linear, loss))
        ends = " to ".join(f"{each}" for each in errors.T)
        texts.append(f"{condition} {ends} deg, the linear model's loss {linear}")
    return graded(all(close), all(more), "; ".join(texts))


@EXPERIMENT.claim(
    "On joints 2 and 3 the polynomial is much worse than network and linear model, and unstable, in all conditions",
    "II-G",
    "no numbers",
    f"both others' errors, mean of the hours, less by more than {100.0 * CONSIDERABLE:.0f} % and the spread over "
    "robots, on both joints in all three conditions; beside it, its errors scatter more over training sets; same "
    "direction: the former in more than half of six",
)
def _unstable_polynomial(o: Outcomes) -> Judgement:
    worse, unstable, texts = [], [], []
    for condition in CONDITIONS:
        by_set = {model: measured(o, condition, model).mean(axis=2)[..., 1:] for model in (POLYNOMIAL, *LEARNT)}
        mean = {model: hourly(o, condition, model).mean(axis=1)[:, 1:] for model in by_set}
        scatter = {model: errors.std(axis=1).mean(axis=0) for model, errors in by_set.items()}
        worse += list(np.all([less(mean[each], mean[POLYNOMIAL], CONSIDERABLE) for each in LEARNT], axis=0))
        unstable += list(np.all([scatter[POLYNOMIAL] > scatter[each] for each in LEARNT], axis=0))
        over = mean[POLYNOMIAL] / np.max([mean[each] for each in LEARNT], axis=0)
        texts.append(f"{condition} J2 {over[:, 0]:.2f}, J3 {over[:, 1]:.2f} times")
    return statement(worse, unstable, "error over the worse of network and linear model: " + ", ".join(texts))


@EXPERIMENT.claim(
    "Longer training is better in hour 5",
    "II-G, figure 6",
    "in many entries, especially for regressions; no numbers",
    f"mean of training sets over 800 s less than of those under 500 s, {CLEARLY}, for linear model and network on "
    "every joint, unloaded and loaded; same direction: in more than half",
    _DRIFT,
)
def _longer_is_better(o: Outcomes) -> Judgement:
    parts, texts = [], []
    for condition in MOVED:
        for model in LEARNT:
            short, long = (hourly(o, condition, model, sets)[:, -1] for sets in (SHORT, LONG))
            parts += list(less(long, short))
            texts.append(f"{condition}, {model} {changes(short, long)}")
    return by_count(parts, "from short to long training: " + "; ".join(texts))


@EXPERIMENT.claim(
    "Training over 800 s is considerably better than under 500 s in many entries, of regressions above all",
    "II-G, figure 6",
    "arrows in the picture, no numbers",
    f"more than {100.0 * CONSIDERABLE:.0f} % better, mean over robots, in at least {100.0 * MANY:.0f} % of the entries "
    "(joints, hours, conditions) of linear model and polynomial, and of each in a larger share than of the network's; "
    f"same direction: the latter. Arrows in the picture also want the paper's box higher than {WIDE} deg or mm",
    "the linear model learned from short recordings what it can; the polynomial did not, nor the network on joint 3",
)
def _arrows(o: Outcomes) -> Judgement:
    marked = {
        model: np.concatenate([considerably_better(o, condition, model).ravel() for condition in CONDITIONS])
        for model in (*REGRESSIONS, NETWORK)
    }
    text = ", ".join(f"{model} {each.sum()} of {each.size}" for model, each in marked.items())
    regressions = float(np.mean([marked[model].mean() for model in REGRESSIONS]))
    more = all(marked[model].mean() > marked[NETWORK].mean() for model in REGRESSIONS)
    return graded(regressions >= MANY and more, more, f"entries that are considerably better: {text}")


@EXPERIMENT.claim(
    "Unloaded, joint 1, after hour 3: longer training helps the linear model, and the network less",
    "II-G",
    "no numbers",
    f"linear model, sets over 800 s less than under 500 s, {CLEARLY}, in hours 3, 4 and 5; beside it, the network "
    "gains a smaller share; same direction: the former in two",
    _DRIFT,
)
def _linear_after_hour_3(o: Outcomes) -> Judgement:
    ends = {model: [hourly(o, "unloaded", model, sets)[:, LATE, 0] for sets in (SHORT, LONG)] for model in LEARNT}
    gained = {model: 1.0 - long / short for model, (short, long) in ends.items()}
    text = "; ".join(
        f"{model} by " + ", ".join(f"{100.0 * each:.1f} %" for each in shares.T) for model, shares in gained.items()
    )
    short, long = ends["linear"]
    gains_less = gained[NETWORK].mean(axis=0) < gained["linear"].mean(axis=0)
    return statement(less(long, short), gains_less, f"longer training better in hours 3, 4, 5: {text}")
