"""Which kind of model `auto` chooses for which joint of a real arm, and how good that was afterwards.

A da Vinci PSM (Hwang et al., RA-L 2020), nine recordings. `auto` chooses on blocks of time of the first 80 % of a
recording and is tested on its rest; from each of the four long ones it also chooses on the whole, and is tested on the
other recordings. Beside it stands every single kind, fitted to the same rows; the best of them on the test is known
only afterwards. Camera failures of `sampled_train` are left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import Evaluation, evaluate
from catenary.calibration.fit_options import FOLDS, FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.kind_choice import block_squares
from catenary.calibration.model_kinds import TRIED
from catenary.calibration.recordings import error_limits
from papers.beyond.intervals import DVRK_UNITS, LATER, RECORDINGS, TRAININGS
from papers.calibration.dvrk import HELD_OUT, limit_of, log_of
from papers.experiment import Case, Experiment, Judgement, Outcomes, Plain, Report, Result, Scope, run
from papers.kit import filled, graded, table

AUTO = "auto"
WITHIN = 1.05  # times the error of the single kind that turns out best


@run(revision=2)
def dvrk_advice(recording: str, others: Sequence[str], data: Path) -> Result:
    """Return RMSE by test and kind, in deg and mm, and what was chosen by which errors."""

    def fitted(kind: str) -> FitResult:
        held_out = None if others else HELD_OUT
        settings = FitRun(held_out=held_out, max_error=limit_of(recording), folds=FOLDS if kind == AUTO else 0)
        return fit_logs([log_of(recording, data)], FitOptions(kind=kind), settings)

    fits = {kind: fitted(kind) for kind in (*TRIED, AUTO)}
    tests: dict[str, Plain] = {}
    excess: dict[str, Plain] = {}
    for name in others or (LATER,):
        found: dict[str, Evaluation] = {}
        for kind, result in fits.items():
            if result.held_out is not None:
                found[kind] = result.held_out
                continue
            log = log_of(name, data)
            limits = error_limits(limit_of(name), log)
            rows = calibration_data([log], result.model.features, max_error=limits)
            found[kind] = evaluate(result.model, rows)
        tests[name] = {kind: [joint.rmse for joint in each.joints] for kind, each in found.items()}
        excess[name] = excess_errors(found).tolist()
    return {"tests": tests, "excess": excess, "choice": [asdict(choice) for choice in fits[AUTO].choices]}


def excess_errors(found: Mapping[str, Evaluation]) -> np.ndarray:
    """Return by how many standard errors `auto` is worse than the kind that is best on a test, (n,); 0 if it is that.

    Standard errors are of the difference of mean squares over blocks of the test's time.
    """
    squares = {kind: block_squares(each.after_model, each.data.recording) for kind, each in found.items()}
    rmse = np.array([[joint.rmse for joint in found[kind].joints] for kind in TRIED])
    excesses = []
    for j, best in enumerate(rmse.argmin(axis=0)):
        over = squares[AUTO][:, j] - squares[TRIED[best]][:, j]
        error = over.std(ddof=1) / np.sqrt(len(over))
        excesses.append(over.mean() / error if error > 0.0 else 0.0)
    return np.array(excesses)


def cases(scope: Scope) -> list[Case]:
    """Return a case for the last part of every recording, and for the others after each of the long ones."""
    if scope.quick:
        return [dvrk_advice.case(recording="error_exp1", others=[])]
    return [dvrk_advice.case(recording=recording, others=[]) for recording in RECORDINGS] + [
        dvrk_advice.case(recording=recording, others=[name for name in RECORDINGS if name != recording])
        for recording in TRAININGS
    ]


def ratios(errors: Mapping[str, Sequence[float]]) -> np.ndarray:
    """Return the error of `auto` over that of the best single kind, joint by joint, (n,)."""
    best = np.min([errors[kind] for kind in TRIED], axis=0)
    return np.asarray(np.array(errors[AUTO]) / best)


def report(o: Outcomes) -> Report:
    """Return what was chosen, and errors later and elsewhere beside the best single kind."""
    found = list(o.items(dvrk_advice))
    blocks = [
        [told["recording"], kind, *(_of_blocks(choice, kind) for choice in result["choice"])]
        for told, result in found
        for kind in TRIED
        if not told["others"]
    ]
    tests = [
        (told["recording"], test, _cells(errors, [choice["chosen"] for choice in result["choice"]]))
        for told, result in found
        for test, errors in result["tests"].items()
    ]
    later = [[recording, *each] for recording, test, each in tests if test == LATER]
    elsewhere = [[recording, test, *each] for recording, test, each in tests if test != LATER]
    on_others = "`auto` on other recordings, over the kind that is best there"
    return Report(
        filled([
            table(
                "Errors on blocks of the first 80 %, the chosen kind in bold",
                ["recording", "kind", *DVRK_UNITS],
                blocks,
            ),
            table("`auto` on the last fifth, over the kind that is best there", ["recording", *DVRK_UNITS], later),
            table(on_others, ["chosen on", "tested on", *DVRK_UNITS], elsewhere),
        ]),
        {},
        [_REMARK],
    )  # fmt: skip


_REMARK = (
    "Cells: RMSE of `auto`, the kind that it chose, and, where another kind is better on the test, by how much `auto` "
    "is worse and than which. A kind without a number was not tried: too few rows for a polynomial's terms."
)


def _of_blocks(choice: Plain, kind: str) -> str:
    error = choice["errors"].get(kind)
    if error is None:
        return "-"
    return f"**{error:.3g}**" if kind == choice["chosen"] else f"{error:.3g}"


def _cells(errors: Mapping[str, Sequence[float]], chosen: Sequence[str]) -> list[str]:
    found = []
    for j, (ratio, kind) in enumerate(zip(ratios(errors), chosen, strict=True)):
        best = min(TRIED, key=lambda name: errors[name][j])
        worse = "" if ratio < 1.0005 else f" (+{100.0 * (ratio - 1.0):.1f} % than {best})"
        found.append(f"{errors[AUTO][j]:.3g} {kind}{worse}")
    return found


EXPERIMENT = Experiment(
    "beyond-advice", "beyond, which model",
    "The kind of model that is chosen joint by joint, held against every kind", __doc__,
    cases, report, minutes=7.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip


def _no_worse(o: Outcomes, *, later: bool) -> Judgement:
    tests = [each for result in o.of(dvrk_advice) for each in result["tests"].items()]
    over = np.concatenate([np.zeros(0), *(ratios(errors) for test, errors in tests if (test == LATER) == later)])
    met = float((over <= WITHIN).mean()) if len(over) else 0.0
    told = f"{met:.0%} of {len(over)} joints and tests; {over.max(initial=0.0):.2f} times at worst"
    return graded(met == 1.0, met > 0.5, told)


for later, where in ((True, "on the last fifth of a recording."), (False, "on other recordings.")):
    EXPERIMENT.claim(
        f"`auto` is no more than 5 % worse than the best single kind {where}",
        "docs/calibration.md",
        "-",
        "on every joint; same direction: on most",
    )(partial(_no_worse, later=later))
