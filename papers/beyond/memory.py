"""Longer memories for a real wrist: what sums of joints, relaxation and robust training add to play states.

A da Vinci PSM (Hwang et al., RA-L 2020), four recordings. Every candidate takes the inputs of the preset `best`
(positions and play states of each joint) and more. It is chosen on the first 80 % of a recording alone, forwards in
time: trained on the first 40, 60 and 80 % of them and judged on the 20 % that follow. Then it is trained on all of
them, and the last fifth of the recording says what it is worth. As a linear model, which costs nothing, each is also
judged on five blocks with training rows on both sides: what that promises too much is what changes with time. No torque
is recorded, so that there is no memory of it to try. Camera failures of `sampled_train` are left out.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.dataset import error_limits
from catenary.calibration.neural import BEST, fit_neural
from catenary.calibration.predictors import fit_linear
from catenary.units import DISPLAY
from papers.beyond.memories import COUPLING, PAST_THE_ROLL, PITCH_AND_YAW, WRIST, Candidate, bounded, features
from papers.calibration.dvrk import HELD_OUT, RECORDINGS, log_of
from papers.claims import Claims, Missing, graded
from papers.experiment import (
    Case,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Result,
    Scope,
    TitledPicture,
    TitledTable,
    run,
)
from papers.figures import legend_below, panels
from papers.kit import filled, rows, sample, table

TODAY = "today's `best`"
FIRM = Candidate(ridge=100.0)
CANDIDATES: Mapping[str, Candidate] = {
    TODAY: Candidate(),
    "linear part held back more": FIRM,
    "bounded errors": replace(FIRM, bounded=True),
    "later rows twice": replace(FIRM, late_twice=True),
    "previous command": replace(FIRM, history=1),
    "relaxation, 1 to 100 s": replace(FIRM, relaxing=True),
    "friction by travel": replace(FIRM, forgetting=True),
    "play of the coupling matrix": replace(FIRM, combined=COUPLING),
    "play past the roll": replace(FIRM, combined=PAST_THE_ROLL),
    "play of J5-J6 sums": replace(FIRM, combined=PITCH_AND_YAW),
    "J5-J6 sums, bounded": replace(FIRM, combined=PITCH_AND_YAW, bounded=True),
    "J5-J6 sums, bounded, travel, previous": replace(
        FIRM, combined=PITCH_AND_YAW, bounded=True, forgetting=True, history=1
    ),
}
# networks take their time: the steps from today's to the last
NETWORKS = (TODAY, *(name for name in CANDIDATES if name == "linear part held back more" or "J5-J6" in name))
FORWARD, AROUND, LATER = "forward blocks", "blocks between", "last fifth"
PIECES = (0.4, 0.6, 0.8)  # of the training part that come before the next 20 %
BLOCKS = 5
GOAL = 0.9  # of today's error
Rows = NDArray[np.bool_]


@run(revision=1)
def memory_errors(recording: str, candidate: str, network: bool, data: Path) -> Result:
    """Return RMSE per joint [deg|mm] of a candidate, as a network or linear, on forward blocks and the last fifth.

    A linear one also on blocks that have training rows on both sides.
    """
    log, chosen = log_of(recording, data), CANDIDATES[candidate]
    position, usable = np.arange(len(log)) / len(log), _usable(log, recording)
    early = position < 1.0 - HELD_OUT
    tests = {LATER: [(1.0 - HELD_OUT, early, ~early)]}
    part = position / (1.0 - HELD_OUT)
    tests[FORWARD] = [
        ((1.0 - HELD_OUT) * share, part < share, (part >= share) & (part < share + HELD_OUT) & early)
        for share in PIECES
    ]
    if not network:
        block = np.minimum((part * BLOCKS).astype(int), BLOCKS)
        tests[AROUND] = [(1.0 - HELD_OUT, early & (block != k), block == k) for k in range(BLOCKS)]
    shown = np.array([DISPLAY[unit][1] for unit in log.joint_units])
    found = {}
    for name, splits in tests.items():
        left = np.vstack([_left(log, chosen, usable, *split, network=network) for split in splits])
        found[name] = (np.sqrt(np.mean(left**2, axis=0)) * shown).tolist()
    return found


def _usable(log: MotionLog, recording: str) -> Rows:
    """Return rows with a measurement that is no camera failure."""
    limits = error_limits(RECORDINGS[recording], log)
    if limits is None:
        return log.ok
    return np.asarray(log.ok & (np.abs(_errors(log)) <= limits).all(axis=1))


def _errors(log: MotionLog) -> Floats:
    assert log.q_encoder is not None
    return log.q_encoder - log.q_nominal


def _left(
    log: MotionLog, chosen: Candidate, usable: Rows, seen: float, train: Rows, test: Rows, *, network: bool
) -> Floats:
    """Return errors left on the rows of `test` after training on those of `train`, (N, n) [rad|m]."""
    X, error = features(log, chosen, seen), _errors(log)
    complete = usable & np.isfinite(X).all(axis=1)
    train, test = train & complete, test & complete
    A, Y = X[train], error[train]
    if chosen.bounded:
        Y = bounded(A, Y, chosen.ridge)
    if chosen.late_twice:
        half = len(A) // 2
        A, Y = np.vstack([A, A[half:]]), np.vstack([Y, Y[half:]])
    if not network:
        return np.asarray(error[test] - fit_linear(A, Y, ridge=chosen.ridge).predict(X[test]))
    late = np.arange(len(A)) >= 0.8 * len(A)
    settings = replace(BEST, skip_ridge=chosen.ridge)
    correction = fit_neural(A, Y, settings, seed=0, late=late).predict(X[test])
    return np.asarray(error[test] - correction)


def cases(scope: Scope) -> list[Case]:
    """Return a case for every recording and candidate, linear and, of some, as a network."""
    recordings = ("insertion_train",) if scope.quick else tuple(RECORDINGS)
    asked = [(name, False) for name in CANDIDATES]
    asked += [] if scope.quick else [(name, True) for name in NETWORKS]
    return [
        memory_errors.case(recording=recording, candidate=name, network=network)
        for name, network in asked
        for recording in recordings
    ]


def of(o: Outcomes, name: str, *, network: bool, test: str) -> Floats:
    """Return a candidate's RMSE of J4 to J6 by recording, (recordings, 3) [deg]."""
    return sample(o, memory_errors, test, candidate=name, network=network)[:, WRIST]


def shares(o: Outcomes, *, network: bool, test: str) -> dict[str, Floats]:
    """Return every candidate's error over today's on the wrist, by recording and joint, (recordings, 3)."""
    today = of(o, TODAY, network=network, test=test)
    names = [name for name in CANDIDATES if len(o.of(memory_errors, candidate=name, network=network)) == len(today)]
    return {name: of(o, name, network=network, test=test) / today for name in names}


def means(o: Outcomes, *, network: bool, test: str) -> dict[str, float]:
    """Return every candidate's mean RMSE of J4 to J6 over the recordings over today's mean."""
    today = of(o, TODAY, network=network, test=test).mean()
    names = shares(o, network=network, test=test)
    return {name: float(of(o, name, network=network, test=test).mean() / today) for name in names}


def chosen_forwards(o: Outcomes) -> str:
    """Return the network that is best on forward blocks of the training part; the last fifth is not looked at."""
    found = means(o, network=True, test=FORWARD)
    return min(found, key=lambda name: found[name])


def _changed(value: float) -> str:
    return f"{100.0 * (value - 1.0):+.1f}"


def _left_of_today(o: Outcomes, *, network: bool) -> TitledTable:
    tests = (FORWARD, LATER) if network else (AROUND, FORWARD, LATER)

    def row(name: str) -> list[str]:
        told = [means(o, network=network, test=test) for test in tests]
        by_joint = shares(o, network=network, test=LATER)
        if name not in by_joint:
            raise Missing(name)
        return [name, *(_changed(each[name]) for each in told), *map(_changed, by_joint[name].mean(axis=0))]

    title = f"{'Networks' if network else 'Linear models'}: mean RMSE of J4 to J6 over that of today's features [%]"
    return table(title, ["candidate", *tests, *(f"J{j + 1}, {LATER}" for j in WRIST)], rows(row, CANDIDATES))


def report(o: Outcomes) -> Report:
    """Return what every candidate leaves of today's error, linear and as a network, and RMSE of the chosen one."""
    tables = [_left_of_today(o, network=network) for network in (True, False)]
    try:
        best = chosen_forwards(o)
    except Missing:
        return Report(filled(tables))

    def row(recording: str, name: str) -> list[str]:
        (left,) = sample(o, memory_errors, LATER, candidate=name, network=True, recording=recording)[:, WRIST]
        return [recording, name, *(f"{value:.2f}" for value in left)]

    header = ["recording", "network", *(f"J{j + 1} [deg]" for j in WRIST)]
    both = rows(row, RECORDINGS, dict.fromkeys((TODAY, best)))
    tables.append(table("RMSE on the last fifth, today's and the chosen", header, both))
    caption = "Mean RMSE of J4 to J6 of networks, over that of today's `best`"
    return Report(filled(tables), [TitledPicture(caption, _picture(o))], [sentence(o, best)])


def sentence(o: Outcomes, best: str) -> str:
    """Return what the choice promised and what the last fifth then showed."""
    promised, kept = (means(o, network=True, test=test)[best] for test in (FORWARD, LATER))
    by_recording = shares(o, network=True, test=LATER)[best].mean(axis=1)
    return (
        f"Chosen on forward blocks: {best}, {_changed(promised)} % there and {_changed(kept)} % on the last fifth (by "
        f"recording {', '.join(map(_changed, by_recording))} %)."
    )


def _picture(o: Outcomes) -> Any:
    figure, (panel,) = panels(1, 3.6)
    for k, (test, color) in enumerate(((FORWARD, "#7fa3cf"), (LATER, "#2f8f6b"))):
        found = means(o, network=True, test=test)
        at = np.arange(len(found))[::-1] + 0.2 - 0.4 * k
        panel.barh(at, [100.0 * (value - 1.0) for value in found.values()], 0.36, color=color, label=test)
    panel.set_yticks(np.arange(len(found))[::-1], list(found), fontsize=8)
    panel.axvline(100.0 * (GOAL - 1.0), color="#1c2430", lw=0.8, ls="--", label="goal")
    panel.axvline(0.0, color="#1c2430", lw=0.8)
    panel.set_xlabel("change of the mean RMSE of J4 to J6 [%]")
    legend_below(figure, panel)
    return figure


CLAIMS = Claims()


@CLAIMS(
    "A longer memory, chosen on training data alone, lowers the wrist's error by 10 % against `best`.",
    "docs/beyond.md",
    "-",
    "mean RMSE of J4 to J6 over four recordings, last fifth; same direction: lower",
)
def _goal(o: Outcomes) -> Judgement:
    best = chosen_forwards(o)
    reached = means(o, network=True, test=LATER)[best]
    return graded(reached <= GOAL, reached < 1.0, f"{_changed(reached)} % ({best})")


EXPERIMENT = Experiment(
    "beyond-memory", "beyond, longer memory", "Longer memories for a real wrist", __doc__,
    cases, report, minutes=3.0, claims=CLAIMS, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
