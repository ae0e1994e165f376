"""Two coupled friction elements in a real wrist: slack and reversal, error against minutes, other recordings, load.

Joints 5 and 6 of a dVRK PSM hang on cables that both share (Hwang et al., RA-L 2020; quasi-static poses measured by a
camera). Ridge regressions on smooth units take play states of each joint, or friction states of the coupled pair, whose
law is found in the training rows; see transmission/cable_friction.py. Errors are on contiguous blocks, or recordings,
that a model did not see, and on whole other recordings. The jaws of da Vinci tools (Stephens et al., RA-L 2018) carry
loads: models of a folder are told positions alone, the motor's current, or a torque, and predict runs left out, or
every other folder, refreshed by ten seconds of one run and tested on all others; within the valid range or not.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from catenary import MotionLog
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import cross_validate, evaluate, rms
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model_refresh import refresh_model
from catenary.calibration.recordings import Recordings, error_limits
from catenary.recording.logs import read_log
from papers.calibration.dvrk import JOINTS, RECORDINGS, SAMPLED_LIMIT, UNITS, log_of
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.kit import filled, grid, table

PLAY, FRICTION = "play states", "friction states"
METHODS = {PLAY: FitOptions(coupled=()), FRICTION: FitOptions()}
COLORS = {PLAY: "#4b6b94", FRICTION: "#d9622b"}
BEGUN = 10.0  # [s]
MINUTES = (2.0, 4.0, 8.0, 16.0, 40.0)
RANDOM = "random_train"
WITHIN = 0.95  # share of rows
UNDER_LOAD = "Jaw under load, runs left out [deg]"
OTHERS = [[other for other in RECORDINGS if other != name] for name in RECORDINGS]  # than each
ALONE = "error_exp5"  # where J6 alone moves
TOOLS, LOADED = "davinci_tools", {"positions": ("q",), "current": ("q", "current"), "torque": ("q", "tau")}
FOLDERS = ("4L2", "4L4", *(f"4L{joint}{k}" for joint in ("Pitch", "Roll") for k in (1, 2, 3, 4)), "5L2")


@run(revision=2)
def errors(train: Sequence[str], method: str, minutes: float, data: Path) -> Result:
    """Return RMSE per joint [deg|mm] on what models of parts did not see, and on every other long recording.

    Args:
        minutes: How much of each counts; 0 for all.
    """
    fit = fit_logs([_first(log_of(name, data), minutes) for name in train], METHODS[method], _run())
    others = [name for name in RECORDINGS if name not in train]
    return {
        "unseen": [joint.rmse_mean for joint in fit.spread],
        "others": {name: _rmse(fit.model, log_of(name, data)) for name in others},
    }


def _run(folds: int = 5) -> FitRun:
    return FitRun(max_error=SAMPLED_LIMIT, folds=folds)


def _first(log: MotionLog, minutes: float) -> MotionLog:
    """Return the first minutes of a recording; 0 for all."""
    if log.time is None or not minutes:
        return log
    return log.part(0, int(np.searchsorted(log.time - log.time[0], 60.0 * minutes)))


def _rmse(model: Any, log: MotionLog) -> list[float]:
    rows = calibration_data([log], model.features, max_error=error_limits(SAMPLED_LIMIT, log))
    return [joint.rmse for joint in evaluate(model, rows).joints]


@run(revision=2)
def slack(rows: int, data: Path) -> Result:
    """Return J6's position and J5's error [deg] where J6 alone moves: measured, and by models of another recording."""
    log = log_of(ALONE, data).part(0, rows)
    if log.q_encoder is None:
        raise AssertionError("the recording holds measured joints")
    columns = {"J6": np.rad2deg(log.q_nominal[:, 5]), "measured": np.rad2deg(log.q_encoder - log.q_nominal)[:, 4]}
    for method in (PLAY, FRICTION):
        model = fit_logs([log_of(RANDOM, data)], METHODS[method], _run(folds=0)).model
        columns[method] = np.rad2deg(model.calibrate(log) - log.q_nominal)[:, 4]
    columns["measured"] = np.where(log.ok, columns["measured"], np.nan)
    return {name: [None if value != value else value for value in values.tolist()] for name, values in columns.items()}


@run(revision=3)
def loaded(folder: str, signal: str, data: Path) -> Result:
    """Return the RMSE of a jaw [deg] on runs of mixed load that models of a folder's other runs predict, in fours."""
    logs, options = _runs(folder, data), FitOptions(inputs=LOADED[signal])
    inputs = choose_inputs(Recordings.of(logs), options)
    rows = calibration_data(logs, inputs.features)
    return {
        "rmse": cross_validate(rows, lambda train, _: fit_model(train, inputs, options), folds=4).spread[0].rmse_mean
    }


@run(revision=4)
def carried(folder: str, signal: str, data: Path) -> Result:
    """Return by other folder the RMSE of a jaw [deg] by a folder's model, and the share of rows in its valid range.

    The model is refreshed by the first ten seconds of one run, and tested on all others; the median over these runs.
    """
    options = FitOptions(inputs=LOADED[signal])
    model = fit_logs(_runs(folder, data), options).model
    ratios = {}
    for other in (each for each in FOLDERS if each != folder):
        rows = calibration_data(_runs(other, data), model.features)
        errors = []
        for number in np.unique(rows.recording):
            run = rows.rows(rows.recording == number)
            refreshed = refresh_model(model, run.rows(run.time < run.time[0] + BEGUN)).model
            others = rows.rows(rows.recording != number)
            errors.append(
                rms(np.rad2deg(others.error - refreshed.correct(others.X, others.q_nominal, others.leaping)[0]))
            )
        inside = model.correct(rows.X, rows.q_nominal, rows.leaping)[1]
        ratios[other] = [float(np.median(errors)), float(np.mean(inside))]
    return ratios


def _runs(folder: str, data: Path) -> list[MotionLog]:
    return [read_log(path) for path in sorted((data / TOOLS).glob(f"{folder}_*.npz"))]


def cases(scope: Scope) -> list[Case]:
    """Return those of the page: models of one recording, and the first tools."""
    if scope.quick:
        return [slack.case(rows=100), *grid(errors, {"method": (PLAY, FRICTION)}, train=[RANDOM], minutes=2.0)]
    return [
        slack.case(rows=270),
        *grid(errors, {"minutes": MINUTES, "method": (PLAY, FRICTION)}, train=[RANDOM]),
        *grid(loaded, {"folder": FOLDERS[:3], "signal": LOADED}),
    ]


def all_cases(scope: Scope) -> list[Case]:
    """Return all: every recording alone and left out, and every tool."""
    if scope.quick:
        return cases(scope)
    alone = [[name] for name in RECORDINGS]
    return [
        *grid(errors, {"train": [*alone, *OTHERS], "method": METHODS}, minutes=0.0),
        *grid(loaded, {"folder": FOLDERS, "signal": LOADED}),
        *grid(carried, {"folder": FOLDERS, "signal": ("current", "torque")}),
    ]


def report(o: Outcomes) -> Report:
    """Return the tables, the picture of slack, and that of error over minutes."""
    header = ["trained on, tested on, model", *map(" ".join, zip(JOINTS, UNITS, strict=True))]
    unseen, elsewhere = [], []
    for arguments, result in o.items(errors):
        what = ", ".join(
            [*arguments["train"], *([f"{arguments['minutes']:g} minutes"] if arguments["minutes"] else [])]
        )
        unseen.append([f"{what}: {arguments['method']}", *(f"{value:.3f}" for value in result["unseen"])])
        for name, rmse in result["others"].items():
            elsewhere.append([f"{what}; {name}: {arguments['method']}", *(f"{value:.3f}" for value in rmse)])
    by_signal: dict[str, dict[str, float]] = {}
    for arguments, result in o.items(loaded):
        by_signal.setdefault(arguments["signal"], {})[arguments["folder"]] = result["rmse"]
    jaws = [
        [folder, *(f"{of.get(folder, np.nan):.2f}" for of in by_signal.values())]
        for folder in FOLDERS
        if any(folder in of for of in by_signal.values())
    ]
    medians = [np.median(list(of.values())) for of in by_signal.values()]
    jaws += [["median", *(f"{median:.2f}" for median in medians)]] if jaws else []
    pairs: dict[str, list[list[float]]] = {}
    for arguments, result in o.items(carried):
        pairs.setdefault(arguments["signal"], []).extend(result.values())
    others = []
    for signal, of_pairs in pairs.items():
        rmse, inside = np.array(of_pairs).T
        within = inside > WITHIN
        counts = [f"{np.median(rmse[part]):.2f} ({part.sum()})" for part in (within, ~within)]
        others.append([signal, *counts])
    pictures = {}
    if o.of(slack):
        pictures["Where J6 alone moves, J5 is dragged along; models are of another motion"] = _slack(o)
        of_minutes = "RMSE on other recordings by minutes of one: points are recordings, lines their medians"
        pictures[of_minutes] = _minutes(o)
    return Report(
        filled([
            table("RMSE on what models of parts did not see", header, unseen),
            table("RMSE on other recordings", header, elsewhere),
            table(UNDER_LOAD, ["folder", *by_signal], jaws),
            table(
                "Jaw of another folder, refreshed by 10 s: median (pairs) [deg]",
                ["signal", "within the valid range", "beyond"],
                others,
            ),
        ]),
        pictures,
    )  # fmt: skip


def _slack(o: Outcomes) -> Any:
    figure, (path, course) = panels(2, 3.6)
    for result in o.of(slack):
        J6 = np.array(result["J6"], dtype=float)
        series = {"measured": "#1c2430", **COLORS}
        for name, color in series.items():
            error = np.array([np.nan if value is None else value for value in result[name]])
            turns = slice(0, 120)
            style = {"lw": 0.0, "marker": ".", "ms": 4} if name == "measured" else {"lw": 1.2}
            path.plot(J6[turns], error[turns], color=color, label=name, **style)
            course.plot(error, color=color, **style)
    path.set_xlabel("J6, commanded [deg]")
    path.set_ylabel("error of J5 [deg]")
    course.set_xlabel("pose")
    legend_below(figure, path)
    return figure


def _minutes(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.2)
    for k, panel in enumerate(axes, start=3):
        for method, color in COLORS.items():
            by_minutes = {
                arguments["minutes"]: [rmse[k] for rmse in result["others"].values()]
                for arguments, result in o.items(errors)
                if arguments["method"] == method and arguments["minutes"]
            }
            minutes = sorted(by_minutes)
            for a, b in pairwise(minutes):
                panel.plot([a, b], [np.median(by_minutes[a]), np.median(by_minutes[b])], color=color, lw=1.2)
            for each in minutes:
                panel.plot([each] * len(by_minutes[each]), by_minutes[each], ".", color=color, label=method)
        panel.set_xscale("log", base=2)
        panel.set_xticks(MINUTES, [f"{each:g}" for each in MINUTES])
        panel.set_xlabel("minutes of training")
        panel.set_title(f"{JOINTS[k]} [deg]", fontsize=10)
        panel.set_ylim(bottom=0.0)
    legend_below(figure, axes[0])
    return figure


EXPERIMENT = Experiment(
    "beyond-wrist-friction", "beyond II-K", "Friction in a real wrist", __doc__,
    cases, report, minutes=2.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
EVERYTHING = Experiment(
    "beyond-wrist-everything", "beyond II-K", "Friction in a real wrist: every recording, tool and kind", __doc__,
    all_cases, report, minutes=14.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
