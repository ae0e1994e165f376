"""What runs of the 19-joint upper body show: errors by limb and window, shares of PD alone's, errors over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.claims import mean_and_spread
from papers.experiment import Case, Outcomes, Result, Scope
from papers.regressor.dual_arm import ALONE, LIMBS, PICK_UP, SAMPLE, WINDOWS, dual_arm
from papers.regressor.published import ESTIMATION

BEFORE, LEARNT = "before estimation", "estimation, last second"
RESTS = ("rest in pose one", "rest in pose two")
AFTER = "all after estimation"
LABELS = {
    "pd": "PD alone",
    "law": "the paper's law, all the time",
    "rls": "least squares",
    "printed-pd": "PD alone",
    "printed-compact": "law on the compact Z",
    "printed-full": "law on the full Z",
    "printed-longer": "law on the compact Z, estimation from 7 s to the end",
}
QUICK_PACE = 8.0


@dataclass(frozen=True)
class Condition:
    """One row of the tables: what runs on every robot."""

    controller: str
    start: str = "zero"
    payload_kg: float = 0.0

    @property
    def label(self) -> str:
        """The condition in words."""
        if self.controller in ALONE:
            return LABELS[self.controller]
        return f"{LABELS[self.controller]}, from {'zero' if self.start == 'zero' else 'wrong parameters'}"

    @property
    def reference(self) -> "Condition":
        """PD alone with the same damping under the same load."""
        alone = "printed-pd" if self.controller.startswith("printed") else "pd"
        return Condition(alone, payload_kg=self.payload_kg)


def cases_of(conditions: Sequence[Condition], scope: Scope) -> list[Case]:
    """Return a case for every robot and condition; quick ones move eight times as fast."""
    return [
        dual_arm.case(
            seed=seed,
            controller=each.controller,
            start=each.start,
            payload_kg=each.payload_kg,
            pace=QUICK_PACE if scope.quick else 1.0,
        )
        for seed in scope.robots
        for each in conditions
    ]


def results_of(outcomes: Outcomes, condition: Condition) -> list[Result]:
    """Return the results of a condition, one per robot."""
    return outcomes.of(
        dual_arm, controller=condition.controller, start=condition.start, payload_kg=condition.payload_kg
    )


def rms(outcomes: Outcomes, condition: Condition, window: str) -> Floats:
    """Return the RMS errors (robots, 3) of trunk, left and right arm [deg]."""
    results = results_of(outcomes, condition)
    return np.array([[result["rms_deg"][window][limb] for limb in LIMBS] for result in results])


def share(outcomes: Outcomes, condition: Condition, window: str) -> float | None:
    """Return the largest share of PD alone's error that a limb keeps, mean over robots; None where none ran."""
    own, alone = rms(outcomes, condition, window), rms(outcomes, condition.reference, window)
    return float((own / alone).mean(axis=0).max()) if len(own) and len(own) == len(alone) else None


def window_table(outcomes: Outcomes, conditions: Sequence[Condition]) -> Table:
    """Return RMS errors by limb and window, mean and spread over robots."""
    rows = []
    for condition in conditions:
        if not len(rms(outcomes, condition, BEFORE)):
            continue
        for k, limb in enumerate(LIMBS):
            cells = [mean_and_spread(rms(outcomes, condition, window)[:, k]) for window in WINDOWS]
            rows.append([condition.label, limb, *cells])
    spans = [f"{window}, {begin:g}-{end:g} s" for window, (begin, end) in WINDOWS.items()]
    return Table(["controller", "limb", *spans], rows)


def share_table(outcomes: Outcomes, conditions: Sequence[Condition]) -> Table:
    """Return what part of PD alone's error the worst limb keeps, by window."""
    windows = list(WINDOWS)[1:]
    rows = []
    for condition in conditions:
        shares = [share(outcomes, condition, window) for window in windows]
        if condition.controller not in ALONE and shares[0] is not None:
            rows.append([condition.label, *(f"{100.0 * each:.1f} %" for each in shares if each is not None)])
    return Table(["controller", *windows], rows)


def errors_picture(outcomes: Outcomes, conditions: Sequence[Condition]) -> Any:
    """Draw the error of each joint over time of the first robot, a row of trunk, left and right arm per condition."""
    from papers.figures import legend_below, panels

    figure, axes = panels(3, 2.3 * len(conditions) + 0.3, rows=len(conditions), sharex=True)
    for row, condition in enumerate(conditions):
        result = results_of(outcomes, condition)[0]
        errors = np.array(result["errors_deg"])
        time = SAMPLE * np.arange(errors.shape[1])
        for panel, (limb, joints) in zip(axes[3 * row : 3 * row + 3], LIMBS.items(), strict=True):
            for joint in range(joints.start, joints.stop):
                panel.plot(time, errors[joint], linewidth=0.9, label=f"joint {joint - joints.start + 1}")
            panel.axvspan(*ESTIMATION, color="#e8edf3", zorder=0)
            if condition.payload_kg > 0.0:
                panel.axvline(PICK_UP, color="#1c2430", linewidth=0.8, linestyle=":")
            panel.set_title(limb if row == 0 else "", fontsize=10)
        axes[3 * row].set_ylabel(f"{condition.label}\nerror [deg]", fontsize=8)
        level = max(float(np.abs(errors).max()), 1e-3)
        for panel in axes[3 * row : 3 * row + 3]:
            panel.set_ylim(-1.05 * level, 1.05 * level)
    for panel in axes[-3:]:
        panel.set_xlabel("time [s]")
    legend_below(figure, axes[1], columns=8)
    return figure
