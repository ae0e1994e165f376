"""A watch without encoders: how often it is wrong, and which drift it sees.

A simulated robot is calibrated along ten minutes of random motion; the watch learns that day. Then it moves at random,
seen by the robot's own reports alone, as recordings at 30 Hz: hours with nothing imposed (cables set by themselves),
right after and after homing again from the home pose, each hour by a watch that begins anew; and days of fifteen
minutes with one drift: cables that wear (the day after's), the same with a homing before the day, a homing from the
corner of the box, half a kilogram at the wrist from power-on. External encoders tell beside it whether the model is
beyond its intervals: whether on some joint they hold less than 85 % of the errors for 90 % asked.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.calibration.conformal import LENIENCE
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit import FitOptions
from catenary.calibration.fitting import FitRun, fit_logs
from catenary.calibration.model import CalibrationModel
from catenary.calibration.upkeep.watch import DriftWatch, WatchResult
from catenary.recording.raven_transmission import registrations
from catenary.reports.page import Table
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.beyond.day_after import HOMING, LOAD, WEAR, drifted
from papers.beyond.registration import HOME_POSE
from papers.beyond.rehoming import home_from
from papers.calibration.recordings import draws, homed, random_log
from papers.claims import graded
from papers.experiment import (
    NOMINAL,
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Result,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
    run,
)

NOTHING, HOMED = "no drift", "no drift, homed again"
WORN_AND_HOMED = "wear, homed again"
QUIET = (NOTHING, HOMED)
# on the page: what a robot does by itself in two hours of motion, cables that set, is a drift, too
SHOWN = {NOTHING: "nothing imposed", HOMED: "homed again, nothing else imposed"}
DRIFTS = (WEAR, WORN_AND_HOMED, HOMING, LOAD)
ASPECTS = ("homing", "torque", "range")
OPTIONS = FitOptions(kind="linear", inputs=POSITIONING_INPUTS)
COLUMNS = ("encoffsets",)
HOUR = 3600.0
RARE, MOST = 0.05, 0.95  # of hours with nothing imposed, of days with a drift


@run(revision=1)
def watched(seed: int | None, drift: str, training: float, lengths: Sequence[float]) -> Result:
    """Return what a watch saw in each piece of a day, and what share of errors the model's intervals held there.

    Args:
        seed: Of the robot.
        drift: One of QUIET or DRIFTS.
        training: Length of the first day's motion [s].
        lengths: Of the pieces [s], each watched anew.
    """
    plant = homed(seed)
    first = random_log(plant, draws(seed, 80), training, columns=COLUMNS)
    model = fit_logs([first], OPTIONS, FitRun()).model
    plant = _changed(plant, seed, drift)
    found = []
    for number, length in enumerate(lengths):
        log = random_log(plant, draws(seed, 81, number), length, columns=COLUMNS)
        errors = evaluate(model, calibration_data([log], model.features)).joints
        seen = watch_log(model, log)
        found.append(
            {
                "flags": [[flag.joint, flag.aspect, round(flag.time, 1)] for flag in seen.flags],
                "not_watched": list(seen.not_watched),
                "held": [joint.coverage for joint in errors],
            }
        )
    level = 0.9 if model.intervals is None else model.intervals.level
    return {"pieces": found, "lengths": list(lengths), "level": level}


def _changed(plant: CablePlant, seed: int | None, drift: str) -> CablePlant:
    if drift == HOMED:
        home_from(HOME_POSE)(plant)
    elif drift == WORN_AND_HOMED:
        plant = drifted(plant, seed, WEAR)
        home_from(HOME_POSE)(plant)
    elif drift in (WEAR, HOMING, LOAD):
        plant = drifted(plant, seed, drift)
    return plant


def watch_log(model: CalibrationModel, log: MotionLog) -> WatchResult:
    """Return what a watch sees in a recording of a RAVEN-II, row by row."""
    watch, inside = (
        DriftWatch(model, log.joint_names, log.joint_units),
        model.inside(model.features.matrix(log)),
    )
    shifts = registrations(log)
    if shifts is None or log.time is None or log.tau is None:
        raise AssertionError("recordings of this experiment hold offsets, time and torques")
    watch.registered(0.0, shifts[0])
    for time, q, tau, flags in zip(log.time, log.q_nominal, log.tau, inside, strict=True):
        watch.update(float(time), q, tau, flags)
    return watch.result()


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and kind of day."""
    robots = (NOMINAL,) if scope.quick else scope.robots
    training = 120.0 if scope.quick else 600.0
    hours, day = ([120.0], [120.0]) if scope.quick else ([HOUR, HOUR], [900.0])
    return [
        watched.case(seed=seed, drift=drift, training=training, lengths=hours if drift in QUIET else day)
        for seed in robots
        for drift in (*QUIET, *DRIFTS)
    ]


def pieces(outcomes: Outcomes, *drifts: str) -> list[dict[str, Any]]:
    """Return what was seen in every piece of kinds of days, and whether the model was beyond its intervals there."""
    found = []
    for drift in drifts:
        for result in outcomes.of(watched, drift=drift):
            least = result["level"] - LENIENCE * (1.0 - result["level"])
            for piece in result["pieces"]:
                found.append({**piece, "beyond": min(piece["held"]) < least})
    return found


def report(outcomes: Outcomes) -> Report:
    """Return how many pieces raised a flag, by what, how soon, and whether the model still held."""
    rows: list[Sequence[str]] = []
    for drift in (*QUIET, *DRIFTS):
        found = pieces(outcomes, drift)
        if not found:
            continue
        first = [min(flag[2] for flag in piece["flags"]) for piece in found if piece["flags"]]
        by = [
            f"{sum(any(flag[1] == aspect for flag in piece['flags']) for piece in found)}"
            for aspect in ASPECTS
        ]
        rows.append(
            [
                SHOWN.get(drift, drift),
                f"{len(found)}",
                f"{sum(piece['beyond'] for piece in found)}",
                f"{len(first)}",
                *by,
                f"{np.median(first):.0f}" if first else "-",
            ]
        )
    header = [
        "what happened",
        "hours or days",
        "model beyond its intervals",
        "flagged",
        *ASPECTS,
        "first flag s",
    ]
    table = TitledTable(
        "Hours with nothing imposed, days with a drift, and flags raised", Table(header, rows)
    )
    return Report([table], [TitledPicture("Share flagged, and share beyond", _picture(outcomes))])


def _picture(outcomes: Outcomes) -> Any:
    from papers.figures import legend_below, panels

    figure, (panel,) = panels(1, 3.0)
    told = [drift for drift in (*QUIET, *DRIFTS) if pieces(outcomes, drift)]
    for shift, (label, color) in enumerate(
        (("flagged", "#d9622b"), ("model beyond its intervals", "#8a94a3"))
    ):
        shares = []
        for drift in told:
            found = pieces(outcomes, drift)
            shares.append(
                100.0 * np.mean([bool(piece["flags"]) if shift == 0 else piece["beyond"] for piece in found])
            )
        panel.barh(np.arange(len(told)) + 0.4 * shift, shares, height=0.35, color=color, label=label)
    names = [SHOWN.get(drift, drift) for drift in told]
    panel.set_yticks(np.arange(len(told)) + 0.2, names, fontsize=8)
    panel.invert_yaxis()
    panel.set_xlabel("% of hours or days", fontsize=8)
    legend_below(figure, panel, columns=2)
    return figure


def _flagged(found: Sequence[dict[str, Any]]) -> float:
    return float(np.mean([bool(piece["flags"]) for piece in found])) if found else float("nan")


def _judge_quiet(outcomes: Outcomes) -> Judgement:
    found = pieces(outcomes, *QUIET)
    share = _flagged(found)
    told = f"{sum(bool(piece['flags']) for piece in found)} of {len(found)} hours"
    return graded(share <= RARE, share <= 2.0 * RARE, told)


def _judge_seen(outcomes: Outcomes) -> Judgement:
    found = pieces(outcomes, WORN_AND_HOMED, HOMING, LOAD)
    share = _flagged(found)
    told = f"{sum(bool(piece['flags']) for piece in found)} of {len(found)} days"
    return graded(share >= MOST, share >= 0.5, told)


def _judge_unseen(outcomes: Outcomes) -> Judgement:
    found = [piece for piece in pieces(outcomes, WEAR) if piece["beyond"]]
    share = _flagged(found)
    told = f"{sum(bool(piece['flags']) for piece in found)} of {len(found)} days beyond the intervals"
    return graded(share >= MOST, share >= 0.5, told)


PLACE = "docs/how-to-the-day-after.md"
CLAIMS = [
    Claim(
        says="Where nothing was imposed the watch hardly raises a flag.",
        place=PLACE,
        published="-",
        criterion="in at most 5 % of hours; same direction: 10 %",
        judge=_judge_quiet,
    ),
    Claim(
        says="It sees a load, a homing elsewhere, and wear once the robot is homed again.",
        place=PLACE,
        published="-",
        criterion="on 95 % of days; same direction: half of them",
        judge=_judge_seen,
    ),
    Claim(
        says="It sees wear before the next homing.",
        place=PLACE,
        published="-",
        criterion="on 95 % of days on which the model is beyond its intervals; same direction: half",
        judge=_judge_unseen,
        why="wear that no homing has followed leaves motor positions, torques and offsets as they were: only the "
        "joints are elsewhere, and nothing on the motors' side tells",
    ),
]

EXPERIMENT = Experiment(
    name="beyond-watch",
    paper="beyond",
    place="beyond, watch",
    title="A watch without encoders",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=5.0,
    claims=CLAIMS,
    drawn=5,
)
