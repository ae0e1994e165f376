"""The day after: what minutes of a new day mend of a model that has drifted.

A simulated robot is calibrated along ten minutes of random motion. Then one thing happens to it: its cables wear (they
set by a part of the largest set, and lose stiffness), it is homed from the corner of its box, or it is switched on anew
with half a kilogram at its wrist. A new day of fifteen minutes of other random motion follows. Its first one and five
minutes refresh the model; errors are those on what comes after the fifth minute, beside those of a model of the same
kind that is fitted to the whole new day, the tested part of it included: the strictest comparison.

Pairs of recordings of a real arm, in either order: the learner before, after the first one and five
minutes of the second recording, and fitted to all of it; errors on what comes after the fifth minute.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_refresh import refresh_model
from catenary.calibration.recordings import Recordings
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.beyond.registration import ELBOW_FIRST
from papers.beyond.rehoming import home_from
from papers.calibration.dvrk import JOINTS as DVRK_JOINTS
from papers.calibration.dvrk import RECORDINGS, log_of
from papers.calibration.dvrk import UNITS as DVRK_UNITS
from papers.calibration.recordings import draws, fitted, homed, random_log, rmse
from papers.experiment import NOMINAL, Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.kit import JOINTS, UNITS, cells, filled, graded, grid, rows, sample, table

WEAR, HOMING, LOAD = "wear", "homing", "load"
DRIFTS = (WEAR, HOMING, LOAD)
SET, LOSS, PAYLOAD = 0.3, 0.08, 0.5  # of the largest set, of the stiffness, [kg]
MODELS = {"linear": FitOptions(kind="linear", inputs=POSITIONING_INPUTS), "learner": FitOptions()}
MINUTE = 60.0
BEFORE, ONE, FIVE, ALL = "before", "1 minute", "5 minutes", "all"
STAGES = (BEFORE, ONE, FIVE, ALL)
WITHIN = 1.15  # of the error of a model fitted to all of the new day


@run(revision=5)
def simulated_day(seed: int | None, drift: str, training: float, day: float) -> Result:
    """Return RMSE on J1 [deg], J2 [deg], J3 [mm] by model and stage.

    Args:
        training: Length of the first day's motion [s].
        day: Length of the new day's [s].
    """
    plant = homed(seed)
    first = random_log(plant, draws(seed, 70), training)
    second = random_log(drifted(plant, seed, drift), draws(seed, 71), day)
    by_model = {}
    for name, options in MODELS.items():
        by_model[name] = _stages(fitted([first], options), fitted([second], options), second)
    return by_model


def drifted(plant: CablePlant, seed: int | None, drift: str) -> CablePlant:
    """Return a robot after one of DRIFTS: the same one, or for a load, which it has from power-on, another alike."""
    if drift == LOAD:
        return homed(seed, payload=PAYLOAD)
    if drift == HOMING:
        home_from(ELBOW_FIRST)(plant)
    else:
        plant.state.slack += SET * plant.cable.largest_set * plant.cable.set_side
        plant.state.loss += LOSS
    return plant


@run(revision=5)
def recorded_day(train: str, test: str, data: Path) -> Result:
    """Return RMSE per joint [deg|mm] by stage, of a model of one recording on what comes after another's minutes."""
    first, second = (log_of(name, data) for name in (train, test))
    options, models = FitOptions(), list[CalibrationModel]()
    for log in (first, second):
        inputs = choose_inputs(Recordings.of([log]), options)
        rows = calibration_data([log], inputs.features, max_error=_limits(log.name))
        models.append(fit_model(rows, inputs, options))
    return _stages(models[0], models[1], second, _limits(second.name))


def _limits(name: str) -> NDArray[np.float64] | None:
    if RECORDINGS.get(name) is None:
        return None
    scale = np.array([1e-3 if unit == "mm" else np.deg2rad(1.0) for unit in DVRK_UNITS])
    return np.asarray(np.array(RECORDINGS[name], dtype=float) * scale)


def _stages(
    old: CalibrationModel, refit: CalibrationModel, log: MotionLog, limits: Floats | None = None
) -> dict[str, list[float]]:
    new, of_refit = (calibration_data([log], model.features, max_error=limits) for model in (old, refit))
    since = new.time - new.time[0]
    late = since >= 5.0 * MINUTE
    models = {BEFORE: old}
    for name, minutes in ((ONE, 1.0), (FIVE, 5.0)):
        models[name] = refresh_model(old, new.rows(since < minutes * MINUTE)).model
    by_stage = {name: rmse(model, new.rows(late)) for name, model in models.items()}
    return by_stage | {ALL: rmse(refit, of_refit.rows(late))}


def pairs() -> list[tuple[str, str]]:
    """Return pairs of recordings of a real arm, either of which may come first."""
    return [(a, b) for a in RECORDINGS for b in RECORDINGS if a != b]


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and drift, and for every pair of recordings."""
    robots = (NOMINAL,) if scope.quick else scope.robots
    training, day = (120.0, 360.0) if scope.quick else (600.0, 900.0)
    chosen = pairs()[:1] if scope.quick else pairs()
    return [
        *grid(simulated_day, {"seed": robots, "drift": DRIFTS}, training=training, day=day),
        *(recorded_day.case(train=a, test=b) for a, b in chosen),
    ]


def ratios(o: Outcomes, drift: str, model: str) -> Floats:
    """Return the error after five minutes over that of a model of all of the day, (robots, 3)."""
    five, whole = (sample(o, simulated_day, model, stage, drift=drift) for stage in (FIVE, ALL))
    return five / whole


def report(o: Outcomes) -> Report:
    """Return the errors of every stage, and how near five minutes come to all of the day."""

    def stages(drift: str) -> list[list[str]]:
        def row(model: str, stage: str) -> list[str]:
            return [f"{model}, {stage}", *cells(sample(o, simulated_day, model, stage, drift=drift))]

        return rows(row, MODELS, STAGES)

    def near(drift: str, model: str) -> list[str]:
        over = ratios(o, drift, model)
        return [f"{drift}, {model}", *cells(over, 2), f"{int((over <= WITHIN).sum())} of {over.size}"]

    of_drift = ["model, refreshed with", *(f"{j} {u}" for j, u in zip(JOINTS, UNITS, strict=True))]
    recorded = [
        [f"{arguments['train']} to {arguments['test']}, {stage}", *(f"{value:.3f}" for value in result[stage])]
        for arguments, result in o.items(recorded_day)
        for stage in STAGES
    ]
    of_pair = ["model of, on, refreshed with", *map(" ".join, zip(DVRK_JOINTS, DVRK_UNITS, strict=True))]
    five = "Error after five minutes over that of a model of all"
    return Report(
        filled([
            *(table(f"{each}: RMSE after the fifth minute, over robots", of_drift, stages(each)) for each in DRIFTS),
            table(five, ["drift, model", *JOINTS, "within 15 %"], rows(near, DRIFTS, MODELS)),
            table("A real arm: RMSE after the fifth minute", of_pair, recorded),
        ])
    )  # fmt: skip


EXPERIMENT = Experiment(
    "beyond-day-after", "beyond figure 9", "The day after", __doc__,
    cases, report, minutes=2.0, drawn=5, needs_data=True,
)  # fmt: skip


@EXPERIMENT.claim(
    "Five minutes of a new day bring the error on its rest to within 15 % of a model trained on all of it.",
    "docs/how-to-the-day-after.md",
    "-",
    "on every joint, drift and robot; same direction: in the median",
    "a learner of all of the day has learnt the tested part, too; refreshed, it errs less than a linear model of all",
)
def _near_all(o: Outcomes) -> Judgement:
    over = np.concatenate([ratios(o, drift, model) for drift in DRIFTS for model in MODELS]).ravel()
    met, median = float((over <= WITHIN).mean()), float(np.median(over))
    measured = (
        f"{met:.0%} of joints, drifts and robots; {median:.2f} times the error in the median, {over.max():.2f} at worst"
    )
    return graded(met == 1.0, median <= WITHIN, measured)
