"""Few minutes: the error after half a minute of training, one, two, four, eight, and all of it.

Every model is fitted to the first minutes of what it may learn from, play widths and valid range included, and tested
on the same rows. Real arm: a da Vinci PSM (Hwang et al., RA-L 2020), four recordings of way-points; the first 80 % are
learnt from, the rest is the test. A minute there is as many rows as the recording has in one at its median step, since
the camera's pauses are no training. Camera failures of `sampled_train` are left out. Simulated RAVEN-IIs: 12 minutes of
random motion with torques, then 4 minutes of other random motion as the test. The paper's network has no memory, as
published. Ours are preset `best` without a prior, the same begun at the prior that simulated arms have taught (`make
prior`; none of the robots here is among them), and what the prior makes of a linear model with the same inputs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data, error_limits, sampling_rate
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions
from catenary.calibration.fit_rows import SMALLEST_DATA, choose_inputs, fit
from catenary.recording.logs import read_log
from catenary.reports.page import Table
from catenary.workflows.identify import part_of
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration.dvrk import FOLDER, HELD_OUT, RECORDINGS
from papers.calibration.dvrk import JOINTS as DVRK_JOINTS
from papers.calibration.dvrk import UNITS as DVRK_UNITS
from papers.calibration.recordings import JOINTS, UNITS, draws, homed, random_log, rows_of
from papers.claims import graded, mean_and_spread
from papers.experiment import (
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Plain,
    Report,
    Result,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
    run,
)
from papers.figures import legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPER, BEST, PRIOR, LINEAR = "neural, paper", "neural, best", "best, prior", "linear, prior"
MODELS = {
    PAPER: FitOptions(kind="neural", preset="paper"),
    BEST: FitOptions(kind="neural", preset="best"),
    PRIOR: FitOptions(kind="neural", preset="best", prior="simulated"),
    LINEAR: FitOptions(kind="linear", prior="simulated", play=PLAY_SHARES),
}
COLORS = {PAPER: "#d9622b", BEST: "#2f8f6b", PRIOR: "#8455a8", LINEAR: "#7fa3cf"}
MINUTES = (0.5, 1.0, 2.0, 4.0, 8.0)
TENTH, HALF, ALL = "a tenth", "half", "all"
SHARES = {TENTH: 0.1, HALF: 0.5, ALL: 1.0}
TRAINING, TEST = 720.0, 240.0  # [s] of a simulated robot's motion
TRAININGS = 3  # of every network
REACHED = 1.005  # times the error that is to be reached: equal to two digits


@run(revision=1)
def recorded_curve(recording: str, model: str, seed: int, data: Path) -> Result:
    """Return, by length of training, the rows learnt from and the RMSE per joint [deg|mm] on the last fifth."""
    return curve_of(recording, replace(MODELS[model], seed=seed), data)


def curve_of(recording: str, options: FitOptions, data: Path) -> Result:
    """Return the same of a model with any options."""
    log = read_log(data / FOLDER / f"{recording}.npz")
    rate = sampling_rate(log)
    if rate is None:
        raise AssertionError("the recordings have time stamps")
    rows = {text(m): 60.0 * m * rate / len(log) for m in MINUTES}
    shares = {name: share for name, share in rows.items() if share < 1.0 - HELD_OUT}
    shares |= {name: (1.0 - HELD_OUT) * share for name, share in SHARES.items()}
    limits = error_limits(RECORDINGS[recording], log)
    found = {}
    for name, share in shares.items():
        inputs = choose_inputs([log], options, held_out=1.0 - share)
        everything = calibration_data([log], inputs.features, max_error=limits)
        train = everything.rows(everything.position < share)
        if len(train) >= SMALLEST_DATA:
            test = everything.rows(everything.position >= 1.0 - HELD_OUT)
            fitted = fit(train, inputs, options)
            found[name] = {"rows": len(train), "rmse": [joint.rmse for joint in evaluate(fitted, test).joints]}
    return found


@run(revision=1)
def simulated_curves(seed: int | None, models: Sequence[str], training: float, test: float) -> Result:
    """Return, by model and length of training, rows and RMSE on J1 [deg], J2 [deg], J3 [mm] of other motion."""
    plant = homed(seed)
    log = random_log(plant, draws(seed, 80), training)
    later = random_log(plant, draws(seed, 81), test)
    shares = {text(m): 60.0 * m / training for m in MINUTES if 60.0 * m < training} | SHARES
    return {
        model: _curve(log, later, replace(MODELS[model], inputs=POSITIONING_INPUTS, play=None), shares)
        for model in models
    }


def _curve(log: MotionLog, later: MotionLog, options: FitOptions, shares: Mapping[str, float]) -> Plain:
    found = {}
    for name, share in shares.items():
        part = part_of(log, (0, round(share * len(log))))
        inputs = choose_inputs([part], options)
        fitted = fit(calibration_data([part], inputs.features), inputs, options)
        errors = [joint.rmse for joint in evaluate(fitted, rows_of(fitted, later)).joints]
        found[name] = {"rows": len(part), "rmse": errors}
    return found


def text(minutes: float) -> str:
    """Return a length of training as the tables name it."""
    return f"{minutes:g} min"


def cases(scope: Scope) -> list[Case]:
    """Return a case for every recording, simulated robot and model."""
    if scope.quick:
        return [recorded_curve.case(recording="insertion_train", model=BEST, seed=0)]
    return [
        recorded_curve.case(recording=recording, model=model, seed=seed)
        for recording in RECORDINGS
        for model in MODELS
        for seed in (scope.network_seeds[:TRAININGS] if model != LINEAR else (0,))
    ] + [simulated_curves.case(seed=seed, models=list(MODELS), training=TRAINING, test=TEST) for seed in scope.robots]


def stages() -> list[str]:
    """Return the lengths of training in the order of the tables."""
    return [*map(text, MINUTES), *SHARES]


def errors(results: Sequence[Result]) -> dict[str, Floats]:
    """Return RMSE by length of training, (trainings or robots, joints)."""
    found = {}
    for stage in stages():
        values = [result[stage]["rmse"] for result in results if stage in result]
        if values:
            found[stage] = np.array(values)
    return found


def report(outcomes: Outcomes) -> Report:
    """Return a table of every recording and of the simulated robots, what was reached, and the curves."""
    tables, pictures = [], []
    for name in RECORDINGS:
        curves = {model: outcomes.of(recorded_curve, recording=name, model=model) for model in MODELS}
        table = _table(curves, DVRK_JOINTS, DVRK_UNITS)
        if table.rows:
            tables.append(TitledTable(f"{name}: RMSE on the last fifth, mean and spread over trainings", table))
    of_robots = {
        model: [result[model] for result in outcomes.of(simulated_curves) if model in result] for model in MODELS
    }
    table = _table(of_robots, JOINTS, UNITS)
    if table.rows:
        tables.append(TitledTable("Simulated robots: RMSE on other motion, mean and spread over robots", table))
    reached = _reached(outcomes)
    if reached.rows:
        tables.append(TitledTable("Error over the one that is to be reached, mean over trainings", reached))
    gained = _gained(outcomes)
    if gained.rows:
        tables.append(TitledTable(f"Error with the prior over `{BEST}` of the same rows, geometric mean", gained))
    shown = [name for name in RECORDINGS if outcomes.of(recorded_curve, recording=name)]
    if shown:
        caption = "RMSE over rows of training by joint, real arm: geometric mean over the recordings"
        pictures.append(TitledPicture(caption, _picture(outcomes, shown)))
    return Report(tables, pictures)


def _table(curves: Mapping[str, Sequence[Result]], joints: Sequence[str], units: Sequence[str]) -> Table:
    rows: list[Sequence[str]] = []
    for model, results in curves.items():
        for stage, values in errors(results).items():
            learnt = round(float(np.mean([result[stage]["rows"] for result in results if stage in result])))
            cells = [mean_and_spread(values[:, j], 3) for j in range(len(joints))]
            rows.append([f"{model}, {stage}", str(learnt), *cells])
    header = ["model, training", "rows", *(f"{j} {u}" for j, u in zip(joints, units, strict=True))]
    return Table(header, rows)


def ratios(outcomes: Outcomes, model: str, stage: str, other: str) -> dict[str, Floats]:
    """Return the error of a model of part of a recording over another's of all of it, by recording, (6,)."""
    found = {}
    for name in RECORDINGS:
        part = errors(outcomes.of(recorded_curve, recording=name, model=model)).get(stage)
        whole = errors(outcomes.of(recorded_curve, recording=name, model=other)).get(ALL)
        if part is not None and whole is not None:
            found[name] = part.mean(axis=0) / whole.mean(axis=0)
    return found


GOALS = ((TENTH, PAPER), (HALF, BEST))  # from so much of a recording, the error of this model of all of it


def _reached(outcomes: Outcomes) -> Table:
    rows: list[Sequence[str]] = []
    for stage, other in GOALS:
        for model in MODELS:
            for name, over in ratios(outcomes, model, stage, other).items() if model != PAPER else ():
                met = int((over <= REACHED).sum())
                cells = [f"{value:.2f}" for value in over]
                rows.append([f"{model} of {stage} / {other} of all", name, *cells, f"{met} of {len(over)}"])
    return Table(["models", "recording", *DVRK_JOINTS, "reached"], rows)


def gains(outcomes: Outcomes, model: str, stage: str) -> dict[str, Floats]:
    """Return the error of a model over that of `best` of the same rows: by arm, (recordings or robots, joints)."""
    real = []
    for name in RECORDINGS:
        pair = [errors(outcomes.of(recorded_curve, recording=name, model=m)).get(stage) for m in (model, BEST)]
        if pair[0] is not None and pair[1] is not None:
            real.append(pair[0].mean(axis=0) / pair[1].mean(axis=0))
    robots = [each for each in outcomes.of(simulated_curves) if stage in each.get(model, ())]
    simulated = [np.divide(each[model][stage]["rmse"], each[BEST][stage]["rmse"]) for each in robots if BEST in each]
    found = {"real": real, "simulated": simulated}
    return {arm: np.array(values) for arm, values in found.items() if values}


def _gained(outcomes: Outcomes) -> Table:
    rows: list[Sequence[str]] = []
    for model in (PRIOR, LINEAR):
        for arm in ("real", "simulated"):
            for stage in stages():
                over = gains(outcomes, model, stage).get(arm)
                if over is not None:
                    middle = float(np.exp(np.log(over).mean()))
                    joints = [f"{value:.2f}" for value in np.exp(np.log(over).mean(axis=0))]
                    cells = [*joints, *["-"] * (len(DVRK_JOINTS) - len(joints))]
                    extremes = f"{over.min():.2f} to {over.max():.2f}"
                    rows.append([f"{model}, {arm}, {stage}", *cells, f"{middle:.2f}", extremes])
    return Table(["model, arm, training", *DVRK_JOINTS, "all", "of single joints"], rows)


def _picture(outcomes: Outcomes, recordings: Sequence[str]) -> "Figure":
    figure, axes = panels(len(DVRK_JOINTS), 3.2)
    for j, panel in enumerate(axes):
        for model in MODELS:
            curves = [errors(outcomes.of(recorded_curve, recording=name, model=model)) for name in recordings]
            places = [stage for stage in (*map(text, MINUTES), ALL) if all(stage in each for each in curves)]
            middle = [np.exp(np.mean([np.log(each[s][:, j].mean()) for each in curves])) for s in places]
            panel.plot(places, middle, color=COLORS[model], marker="o", markersize=3, label=model)
        panel.set_title(f"{DVRK_JOINTS[j]} [{DVRK_UNITS[j]}]", fontsize=10)
        panel.tick_params(axis="x", rotation=60, labelsize=8)
        panel.set_ylim(bottom=0.0)
    legend_below(figure, axes[0], columns=3)
    return figure


def _judged(model: str, stage: str, other: str) -> Claim:
    def judge(outcomes: Outcomes) -> Judgement:
        found = ratios(outcomes, model, stage, other)
        over = np.concatenate(list(found.values()))
        met = int((over <= REACHED).sum())
        middle = float(np.exp(np.log(over).mean()))
        told = f"{met} of {len(over)} joints and recordings; {middle:.2f} times in the mean, {over.max():.2f} at worst"
        return graded(met == len(over), middle <= 1.0, told)

    return Claim(
        says=f"`{model}` of {stage} of a recording errs no more than `{other}` of all of it.",
        place="docs/calibration.md",
        published="-",
        criterion="on every joint of four recordings; same direction: in the geometric mean",
        judge=judge,
    )


EXPERIMENT = Experiment(
    name="beyond-few-minutes",
    paper="beyond",
    place="beyond, few minutes",
    title="Error over minutes of training",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=7.0,
    claims=[_judged(model, stage, other) for stage, other in GOALS for model in MODELS if model != PAPER],
    drawn=5,
    needs_data=True,
)
