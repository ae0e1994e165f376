"""Table V of the calibration paper: network or linear regression, aspect by aspect, all measured.

The paper's table has six rows; a seventh is what its text adds (III): whether training or recording takes the time.
Accuracy and data hunger are means over six hours of figure 6 with the three longest and the three shortest training
sets; training on the error is table II's comparison; irrelevant features are figure 8's, 16 inputs against all 138 with
the time stamp after the three longest sets, on figure 8's two robots, the larger network against the small one with 16
inputs. All of these run the same cases as there.

Times are of the processor that ran this, one thread. A model answers a row as the robot runs it, compiled, by which
claims are judged, and by one call of a framework, scikit-learn's predict for both, whose overhead is the same for both;
the paper's frameworks are not named. What else runs on the machine slows both.
"""

import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from papers.calibration import figure_8
from papers.calibration.figure_6 import hourly
from papers.calibration.figure_8 import LARGER, errors_of
from papers.calibration.judging import by_joint, changes, less, statement
from papers.calibration.published import TABLE_5_ACCURACY, TABLE_5_HUNGER, TABLE_5_INFERENCE, TABLE_5_TRAINING
from papers.calibration.recordings import METHODS, NETWORK, SPARSITIES, calibration_log, draws, fitted, homed, rows_of
from papers.calibration.six_hours import LONGEST, SHORTEST, Condition, cases_of
from papers.calibration.table_2 import SHOWN as TABLE_2_MODELS
from papers.calibration.table_2 import errors as table_2_errors
from papers.experiment import CLEARLY, NOMINAL, Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.kit import UNITS, as_text, by_count, by_robot, cells, graded, rows, table

KINDS = (NETWORK, "linear")
HIDDEN = (100, 100)  # units of the paper's network
CONDITIONS: tuple[Condition, ...] = ("unloaded", "loaded")
SERVO = 1000.0  # [us], a tick of the servo loop
# criteria
CLOSE = 0.2  # of the linear model's error: very close
MUCH_FASTER = 80.0  # times: half of what the paper has
FASTER = 2.0  # times as fast: more than what runs beside it makes of a time
RUINED = 2.0  # times the error with 16 inputs; the paper's linear model has 5.5, 5.2 and 8.1
REQUIRED, OPTIONAL = 1.5, 0.01  # end to end over on the error: much worse, and no different
MOST = 0.8  # of recording and training together
_CALL = (
    "61 ms are the overhead of a call of the authors' framework; the network itself is twelve thousand multiplications"
)


@run(revision=1)
def speed(sparsities: Sequence[float], trainings: int, calls: int) -> Result:
    """Time network and linear model, trained on the nominal robot's zig-zags.

    Returns:
        `processor`; `recorded` [s] and `rows` of the training set; and by model, medians: `train` [s]; `deployed`, a
        tick of the compiled model as a robot runs it, and `framework`, a call of scikit-learn's predict with a model
        of the same size, both [us] for one row.
    """
    log = calibration_log(homed(NOMINAL), draws(NOMINAL, 80), sparsities=sparsities)
    stamps = np.asarray(log.time)
    times: dict[str, Any] = {"train": {}, "deployed": {}, "framework": {}}
    for kind in KINDS:
        seconds = []
        for _ in range(trainings):
            begin = time.perf_counter()
            model = fitted([log], METHODS[kind])
            seconds.append(time.perf_counter() - begin)
        data = rows_of(model, log)
        tick = Corrector(model).bind(data.q_nominal[0].copy(), data.X[0].copy(), np.zeros(3), np.zeros(3, dtype=bool))
        answer = partial(framework_model(kind, data.X, data.error).predict, data.X[:1].copy())
        times["train"][kind] = float(np.median(seconds))
        times["deployed"][kind] = 1e6 * _median(tick, calls)
        times["framework"][kind] = 1e6 * _median(answer, calls)
    return {"processor": processor(), "recorded": float(stamps[-1] - stamps[0]), "rows": len(log), **times}


def framework_model(kind: str, X: Any, Y: Any) -> Any:
    """Return scikit-learn's model of the paper's size; the network hardly trained: its time is that of its size."""
    if kind == "linear":
        return LinearRegression().fit(X, Y)
    network = MLPRegressor(hidden_layer_sizes=HIDDEN, activation="logistic", random_state=0)
    return network.partial_fit(X[:100], Y[:100])


def processor() -> str:
    """Return the name of this machine's processor."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _median(call: Callable[[], object], times: int) -> float:
    call()  # compiled, and warm
    seconds = []
    for _ in range(times):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))


def cases(scope: Scope) -> list[Case]:
    """Return cases of figure 6, of table II, of figure 8 as far as its own robots, and of the times."""
    if scope.quick:
        timed = speed.case(sparsities=(1.0,), trainings=1, calls=100)
        return [*cases_of(scope, ("unloaded",)), timed]
    return [
        *cases_of(scope, CONDITIONS),
        *cases_of(scope, ("unloaded",), TABLE_2_MODELS, "position"),
        *figure_8.cases(replace(scope, robots=scope.robots[: 1 + figure_8.EXPERIMENT.drawn])),
        speed.case(sparsities=SPARSITIES, trainings=3, calls=5000),
    ]


def six_hours(o: Outcomes, condition: Condition, model: str, sets: Sequence[str]) -> Floats:
    """Return the RMSE (robots, 3), mean over training sets and hours."""
    return by_robot(hourly(o, condition, model, sets).mean(axis=1))


def growth(o: Outcomes, model: str) -> Floats:
    """Return by how many times errors grow with 138 inputs and stamp over 16, (robots, 3); the larger network's over
    the small one's, as in the paper.
    """
    few = errors_of(o, NETWORK if model == LARGER else model, "16")
    many = errors_of(o, model, "stamped")
    return many / few[: len(many)]  # figure 8's robots come first, and are fewer


def end_to_end(o: Outcomes, model: str) -> Floats:
    """Return by how many times errors grow when a model learns positions, (robots, 3)."""
    on_error, position = (table_2_errors(o, model, target) for target in ("error", "position"))
    return position / on_error


def report(o: Outcomes) -> Report:
    """Return the seven aspects, network and linear model beside the paper's, and what was timed where."""
    aspects = (
        ("accuracy", "longest", LONGEST, TABLE_5_ACCURACY),
        ("data hunger", "shortest", SHORTEST, TABLE_5_HUNGER),
    )

    def errors(aspect: Any, condition: Condition) -> list[str]:
        name, length, sets, published = aspect
        texts = [", ".join(cells(six_hours(o, condition, model, sets))) for model in KINDS]
        by = ", ".join(f"{value:.3f} {unit}" for value, unit in zip(published.get(condition, ()), UNITS, strict=False))
        text = f"network better by {by}" if by else "very close"
        return [f"{name}: RMSE, three {length} sets, {condition}", *texts, text]

    def grown(text: str, ratios: Callable[[Outcomes, str], Floats], models: Sequence[str], paper: str) -> list[str]:
        return [text, *(", ".join(cells(ratios(o, model), 2)) for model in models), paper]

    many, linear_paper = "irrelevant features: error with 138 inputs over 16", "linear 5.5, 5.2, 8.1"
    error = "train on error: error end to end over on the error"
    timed = [row for one in o.of(speed) for row in _times(one)]
    content = [
        *rows(errors, aspects, CONDITIONS),
        *timed[:3],
        *rows(lambda: grown(many, growth, KINDS, f"2.1, 2.9, 2.3; {linear_paper}")),
        *rows(lambda: grown(f"{many}, larger network", growth, (LARGER, "linear"), f"1.2, 2.1, 1.4; {linear_paper}")),
        *rows(lambda: grown(error, end_to_end, KINDS, "2.5, 3.3, 9.5; linear 1.0, 1.0, 1.0")),
        *timed[3:],
    ]
    title = "Seven aspects; J1 [deg], J2 [deg], J3 [mm], ± over robots"
    remarks = [f"Timed on {one['processor']}, one thread." for one in o.of(speed)]
    return Report([table(title, ["aspect", NETWORK, "linear", "paper"], content)], {}, remarks)


def _times(times: Result) -> list[list[str]]:
    limits = TABLE_5_TRAINING

    def row(name: str, values: Mapping[str, float], form: str, unit: str, paper: str) -> list[str]:
        return [name, *(f"{values[kind]:{form}} {unit}" for kind in KINDS), paper]

    return [
        row(
            f"training time, {times['rows']} rows", times["train"], ".3g", "s",
            f"below {limits[NETWORK]:.0f} s; linear below {limits['linear']:.0f} s",
        ),
        row(
            "inference time, a row by a framework's call", times["framework"], ".3g", "us",
            f"{TABLE_5_INFERENCE[NETWORK]:.0f} ms; linear {TABLE_5_INFERENCE['linear']:.2f} ms",
        ),
        row("inference time, a row as deployed", times["deployed"], ".3g", "us", "-"),
        row("recording's share of recording and training", _shares(times), ".1f", "%", "recording dominates"),
    ]  # fmt: skip


def _shares(times: Result) -> dict[str, float]:
    """Return the recording's share of recording and training by model [%]."""
    return {kind: 100.0 * times["recorded"] / (times["recorded"] + times["train"][kind]) for kind in KINDS}


def _better(o: Outcomes, sets: Sequence[str], conditions: Sequence[Condition]) -> Judgement:
    """Judge whether the network is better wherever the paper's is."""
    published = TABLE_5_ACCURACY if sets == LONGEST else TABLE_5_HUNGER
    parts, texts = [], []
    for condition in conditions:
        network, linear = (six_hours(o, condition, model, sets) for model in KINDS)
        better = less(network, linear)
        parts += [ours for ours, paper in zip(better, published[condition], strict=True) if paper > 0.0]
        texts.append(f"{condition} {by_joint(linear - network)}")
    return by_count(parts, "network better by " + "; ".join(texts))


# beside the cases of figures 6 and 8 and table II
EXPERIMENT = Experiment(
    "calibration-table-5", "table V", "Network or linear regression", __doc__, cases, report, minutes=3.0, drawn=2
)


@EXPERIMENT.claim(
    "Accuracy with enough data, unloaded: network and linear model are very close",
    "III, table V",
    "no numbers",
    f"errors of six hours, three longest training sets, differ by at most {100.0 * CLOSE:.0f} % of the linear model's "
    "on every joint, mean over robots; same direction: on two",
)
def _accuracy_unloaded(o: Outcomes) -> Judgement:
    network, linear = (six_hours(o, "unloaded", model, LONGEST) for model in KINDS)
    close = np.abs((linear - network).mean(axis=0)) <= CLOSE * linear.mean(axis=0)
    return by_count(close, f"from linear model to network: {changes(linear, network)}")


@EXPERIMENT.claim(
    "Accuracy with enough data, loaded: the network is slightly better",
    "III, table V",
    "by 0.015 deg, 0.109 deg, 0.124 mm",
    f"its error of six hours, three longest training sets, is less, {CLEARLY}, on every joint; same direction: on two",
    "most of six hours' error is drift, which neither model knows; at once after training the network is better on "
    "joint 3 alone (table I)",
)
def _accuracy_loaded(o: Outcomes) -> Judgement:
    return _better(o, LONGEST, ("loaded",))


@EXPERIMENT.claim(
    "Data hunger: with little data the network is better",
    "III, table V",
    "by 0.052 deg, 0.189 deg, -0.037 mm unloaded; 0.128 deg, 0.360 deg, 0.178 mm loaded",
    f"its error of six hours, three shortest training sets, is less, {CLEARLY}, on the five of six where the paper's "
    "is; same direction: on more than half. Figure 5 judges the same right after training",
    "the shortest zig-zags are enough for a linear model of the simulated robot: after them its errors are a tenth "
    "larger than after the longest, at most",
)
def _hunger(o: Outcomes) -> Judgement:
    return _better(o, SHORTEST, CONDITIONS)


@EXPERIMENT.claim(
    "Training takes less than 50 s for the network, less than 2 s for the linear model",
    "III, table V",
    "50 s, 2 s",
    "both within on the processor that ran this, and beside it the linear model faster; same direction: the former",
)
def _training(o: Outcomes) -> Judgement:
    times = o.of(speed)
    train = times[0]["train"]
    within = [train[kind] <= TABLE_5_TRAINING[kind] for kind in KINDS]
    text = f"{train[NETWORK]:.3g} s, linear {train['linear']:.3g} s on {times[0]['processor']}"
    return statement(within, [train["linear"] < train[NETWORK]], text)


def _row_times(o: Outcomes) -> dict[str, tuple[float, float]]:
    """Return the network's and the linear model's times for a row [us], by a framework's call and as deployed."""
    times = o.of(speed)[0]
    return {way: (times[way][NETWORK], times[way]["linear"]) for way in ("framework", "deployed")}


@EXPERIMENT.claim(
    "Inference: the linear model fits the 1000 Hz servo loop, the network does not",
    "III, table V",
    "0.38 ms, 61 ms",
    "by a framework's call for each row, and as deployed, compiled, the linear model takes at most 1 ms, the network "
    "more; a network that fits the loop in either way refutes it",
    _CALL,
)
def _inference(o: Outcomes) -> Judgement:
    times = _row_times(o)
    text = "; ".join(f"{way} {network:.3g} us, linear {linear:.3g} us" for way, (network, linear) in times.items())
    return graded(all(linear <= SERVO < network for network, linear in times.values()), False, text)


@EXPERIMENT.claim(
    "The linear model answers 160 times faster than the network",
    "abstract, table V",
    "61 ms over 0.38 ms, 160 times",
    f"at least {MUCH_FASTER:.0f} times by a framework's call for each row; same direction: more than {FASTER:.0f} "
    "times, so called and as deployed, compiled",
    _CALL,
)
def _times_faster(o: Outcomes) -> Judgement:
    ratios = {way: network / linear for way, (network, linear) in _row_times(o).items()}
    text = "; ".join(f"{way} {ratio:.1f} times" for way, ratio in ratios.items())
    return graded(ratios["framework"] >= MUCH_FASTER, all(ratio > FASTER for ratio in ratios.values()), text)


@EXPERIMENT.claim(
    "Irrelevant features: the linear model is not robust, a larger network is",
    "II-H, III, table V",
    "linear 0.361, 0.355, 0.167 to 1.985 deg, 1.834 deg, 1.352 mm; network 0.328, 0.264, 0.167 to 0.397 deg, 0.565 "
    "deg, 0.229 mm with the larger",
    "with 138 inputs and time stamp for 16, three longest training sets, the linear model's error is at least "
    f"{RUINED} times as large on every joint, mean over robots; beside it the larger network's, over the small one's "
    f"with 16, grows less, {CLEARLY}; same direction: the former on two",
    "the stamp ruins a linear model that was trained on one short recording, and much less one of the three longest "
    "sets (figure 8)",
)
def _irrelevant(o: Outcomes) -> Judgement:
    ratios = {model: growth(o, model) for model in (*KINDS, LARGER)}
    text = "; ".join(f"{model} {by_joint(each, digits=2)}" for model, each in ratios.items())
    linear, larger = ratios["linear"], ratios[LARGER]
    return statement(linear.mean(axis=0) >= RUINED, less(larger, linear), f"in times the error of 16 inputs: {text}")


@EXPERIMENT.claim(
    "Training on the error is required for the network, optional for the linear model",
    "II-J, III, table V",
    "2.5, 3.3, 9.5 times worse end to end; no difference",
    f"end to end the network's error is at least {REQUIRED} times as large, the linear model's within "
    f"{100.0 * OPTIONAL:.0f} %, on every joint, mean over robots; same direction: the former on two joints, and more "
    "than half of six",
)
def _train_on_error(o: Outcomes) -> Judgement:
    network, linear = (end_to_end(o, model) for model in KINDS)
    text = f"in times the error: network {by_joint(network, digits=2)}; linear {by_joint(linear, digits=2)}"
    optional = np.abs(linear.mean(axis=0) - 1.0) <= OPTIONAL
    return statement(network.mean(axis=0) >= REQUIRED, optional, text)


@EXPERIMENT.claim(
    "Recording, not training, takes the time",
    "III",
    "4 to 17 minutes",
    f"at least {100.0 * MOST:.0f} % of recording and training together, for both models",
)
def _recording(o: Outcomes) -> Judgement:
    times = o.of(speed)
    one = times[0]
    shares = _shares(one)
    return by_count([share >= 100.0 * MOST for share in shares.values()], as_text(shares, ".1f", " %"))
