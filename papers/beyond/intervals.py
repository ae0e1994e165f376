"""Intervals of corrections, held against errors on data that the models have not seen.

Each model asks its intervals to hold 90 % of errors. Real arm: a da Vinci PSM (Hwang et al., RA-L 2020), nine
recordings; fitted to the first 80 % of one, tested on the rest of it, and on the others whole. Camera failures of
`sampled_train` are left out. Simulated RAVEN-II: fitted to the first 80 % of 20 minutes of random motion, tested on the
rest, on motion right after, an hour later and after homing again.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import Evaluation, evaluate
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.calibration.recordings import error_limits
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration.dvrk import HELD_OUT, limit_of, log_of
from papers.calibration.recordings import TEST_SECONDS, draws, homed, random_log
from papers.experiment import Case, Experiment, Outcomes, Plain, Report, Result, Scope, run
from papers.kit import IN_UNITS, filled, table

TRAININGS = ("random_train", "insertion_train", "peg_transfer_train", "sampled_train")
RECORDINGS = (*TRAININGS, *(f"error_exp{k}" for k in range(1, 6)))
KINDS = {"linear, play": FitOptions(kind="linear", play=PLAY_SHARES), "learned": FitOptions()}
RAVEN_KINDS = {
    "linear": FitOptions(kind="linear", inputs=POSITIONING_INPUTS),
    "polynomial": FitOptions(kind="polynomial", inputs=POSITIONING_INPUTS),
}
LATER = "its last fifth"
HOUR = 3600.0
DVRK_UNITS = ("J1 [deg]", "J2 [deg]", "J3 [mm]", "J4 [deg]", "J5 [deg]", "J6 [deg]")
FLAGS = {"held": "", "below, which may be chance": "?", "too narrow": "!"}


@run(revision=3)
def dvrk_coverage(recording: str, kind: str, others: Sequence[str], data: Path) -> Result:
    """Fit a kind to the first part of a recording; return, by test, shares held, half-widths and verdicts."""
    trained = fit_logs([log_of(recording, data)], KINDS[kind], FitRun(held_out=HELD_OUT, max_error=limit_of(recording)))
    if trained.held_out is None:
        raise AssertionError("a held-out share gives an evaluation")
    by_test = {LATER: _found(trained.held_out)}
    for name in others:
        log = log_of(name, data)
        rows = calibration_data([log], trained.model.features, max_error=error_limits(limit_of(name), log))
        by_test[name] = _found(evaluate(trained.model, rows))
    return by_test


@run(revision=2)
def raven_coverage(seed: int | None, kind: str, seconds: float, pause: float) -> Result:
    """Fit a kind to random motion of a simulated robot; return the same, later and later."""
    plant = homed(seed)
    trained = fit_logs([random_log(plant, draws(seed, 0), seconds)], RAVEN_KINDS[kind], FitRun(held_out=HELD_OUT))
    if trained.held_out is None:
        raise AssertionError("a held-out share gives an evaluation")

    def tested(number: int, length: float = seconds) -> Plain:
        log = random_log(plant, draws(seed, number), length)
        return _found(evaluate(trained.model, calibration_data([log], trained.model.features)))

    by_test = {LATER: _found(trained.held_out), "motion right after": tested(1)}
    random_log(plant, draws(seed, 2), pause)
    by_test["an hour of motion later"] = tested(3)
    plant.home()
    by_test["after homing again"] = tested(4)
    return by_test


def _found(evaluation: Evaluation) -> Plain:
    return {
        "held": [joint.coverage for joint in evaluation.joints],
        "half_width": [joint.half_width for joint in evaluation.joints],
        "verdict": list(coverage_verdicts(evaluation)),
        "outside": float(np.mean(~evaluation.inside)),
    }


def cases(scope: Scope) -> list[Case]:
    """Return a case for every recording and kind, and for every simulated robot and kind."""
    if scope.quick:
        return [
            dvrk_coverage.case(recording="insertion_train", kind="linear, play", others=["error_exp1"]),
            raven_coverage.case(seed=None, kind="linear", seconds=60.0, pause=60.0),
        ]
    return [
        dvrk_coverage.case(recording=recording, kind=kind, others=[name for name in RECORDINGS if name != recording])
        for recording in RECORDINGS
        for kind in KINDS
    ] + [
        raven_coverage.case(seed=seed, kind=kind, seconds=TEST_SECONDS, pause=HOUR)
        for seed in scope.robots
        for kind in RAVEN_KINDS
    ]


def report(o: Outcomes) -> Report:
    """Return tables of shares held and half-widths: later, elsewhere, and on the simulated robot."""
    later, elsewhere, raven = [], [], []
    for arguments, result in o.items(dvrk_coverage):
        for test, coverage in result.items():
            row = [arguments["recording"], *([] if test == LATER else [test]), arguments["kind"], *_cells(coverage)]
            if test == LATER:
                later.append(row)
            elif arguments["recording"] in TRAININGS and arguments["kind"] == "learned":
                elsewhere.append([arguments["recording"], test, *_cells(coverage)])
    for arguments, result in o.items(raven_coverage):
        robot = "nominal" if arguments["seed"] is None else f"{arguments['seed']}"
        raven += [[robot, arguments["kind"], test, *_cells(coverage)] for test, coverage in result.items()]
    end = [*DVRK_UNITS, "outside"]
    tables = [
        table("Real arm: later blocks of the same recording", ["fitted to", "model", *end], later),
        table("Real arm: other recordings, `learned`", ["fitted to", "tested on", *end], elsewhere),
        table("Simulated RAVEN-II", ["robot", "model", "tested on", *IN_UNITS, "outside"], raven),
    ]
    return Report(filled(tables), {}, _remarks(o))


def _cells(coverage: Plain) -> list[str]:
    cells = [
        f"{100.0 * held:.0f} %{FLAGS[verdict]} ± {width:.3g}"
        for held, width, verdict in zip(coverage["held"], coverage["half_width"], coverage["verdict"], strict=True)
    ]
    return [*cells, f"{100.0 * coverage['outside']:.0f} %"]


def _remarks(o: Outcomes) -> list[str]:
    legend = (
        "Share of errors held by intervals that are to hold 90 %, and their median half-width; `!` too narrow, `?` "
        "below 85 % where blocks of time are too few to exclude chance; last the share of rows outside the valid range."
    )
    later = [result[LATER] for _, result in o.items(dvrk_coverage)]
    others = [coverage for _, result in o.items(dvrk_coverage) for test, coverage in result.items() if test != LATER]
    remarks = [legend]
    for words, tests in (("later blocks of the same recording", later), ("other recordings", others)):
        shares = [share for coverage in tests for share in coverage["held"]]
        verdicts = [verdict for coverage in tests for verdict in coverage["verdict"]]
        if shares:
            within = sum(0.85 <= share <= 0.95 for share in shares)
            remarks.append(
                f"On {words}: {len(shares)} joints and models, median {100.0 * float(np.median(shares)):.0f} % held; "
                f"{within} between 85 and 95 %, {sum(share > 0.95 for share in shares)} above, "
                f"{sum(share < 0.85 for share in shares)} below, of which {verdicts.count('too narrow')} are flagged "
                "as too narrow."
            )
    return remarks


EXPERIMENT = Experiment(
    "beyond-intervals", "beyond, error bars", "Intervals of corrections, held against errors on other data", __doc__,
    cases, report, minutes=3.0, drawn=0, needs_data=True,
)  # fmt: skip
