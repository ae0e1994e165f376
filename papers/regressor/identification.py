"""Gravity parameters of a simulated RAVEN-II from static poses, and what they are worth to PD+DG.

The robot's own control holds 30 random poses on each of three bases, level and tilted twice, each pose reached once
from below and once from above, so that what friction holds cancels in the mean of the two. Masses are believed to be
20 % too large; the compact parameters are fitted with the believed ones as prior. The gravity torque is compared with
the true one at 30 other poses on a fourth base. The level base's poses go through `identify` (terms static) as well,
whose base parameters need no belief.

Joint positions: "reported" is what the robot gives, from its motors; "calibrated" that after a linear model trained on
the published zig-zag; "true" where the links are. The paper has no such experiment: it is a part of what its method
is for.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.claims import mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, TitledPicture
from papers.figures import legend_below, panels
from papers.kit import table
from papers.regressor.raven_identification import BELIEF, ON, POSITIONS, TRUE, identified

AXES = ("J1 [Nm]", "J2 [Nm]", "J3 [N]")
SOURCES = (TRUE, BELIEF, *(f"identified on {on}" for on in ON))
COLORS = ("#b8bfc9", "#8a94a3", "#4b6b94", "#d9622b")


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot."""
    poses, sparsities = (2, (1 / 2,)) if scope.quick else (30, (1 / 2, 1 / 3, 1 / 4))
    return [identified.case(seed=seed, poses=poses, sparsities=sparsities) for seed in scope.robots]


def _of(results: Sequence[Result], key: str, label: str) -> Floats:
    """Return the numbers of a label (robots, 3)."""
    return np.array([result[key][label] for result in results])


def _cells(values: Floats, digits: int) -> list[str]:
    return [mean_and_spread(column, digits) for column in values.T]


def report(o: Outcomes) -> Report:
    """Return torque errors on another base, what poses tell, and PD+DG with what was found."""
    results = o.of(identified)
    errors = [
        [source, at, *_cells(_of(results, "error_Nm_Nm_N", f"{source}, {at}"), 3)]
        for source in SOURCES
        for at in POSITIONS
    ]
    ranks = [
        [
            label,
            ", ".join(sorted({str(one["ranks"][label]) for one in results})),
            str(results[0]["base_parameters"][label.removeprefix("identified on ").split(",")[0]]),
        ]
        for label in results[0]["ranks"]
    ]
    held = [
        [
            source,
            *_cells(_of(results, "pd_share_percent", source), 0),
            *_cells(_of(results, "held_error_deg_deg_mm", source), 3),
        ]
        for source in SOURCES
    ]
    tables = [
        table("Gravity torque at poses on another base, RMS error", ["parameters", "positions", *AXES], errors),
        table("What the poses tell", ["fit", "rank", "base parameters"], ranks),
        table(
            "PD+DG at static poses on that base, reported positions",
            ["parameters", *(f"PD share J{j} [%]" for j in (1, 2, 3)), "error J1 [deg]", "J2 [deg]", "J3 [mm]"],
            held,
        ),
    ]
    remarks = [str(one["identify_Nm_Nm_N"]) for one in results if isinstance(one["identify_Nm_Nm_N"], str)]
    told = [one["identify_Nm_Nm_N"] for one in results if not isinstance(one["identify_Nm_Nm_N"], str)]
    if told:
        words = ", ".join(f"{axis} {value}" for axis, value in zip(AXES, _cells(np.array(told), 3), strict=True))
        remarks.append(
            "`identify` (terms static) of the level base's poses with reported positions, at other poses there, RMS "
            f"error: {words}."
        )
    return Report(
        tables,
        [TitledPicture("RMS error of the gravity torque on another base, by positions", _picture(results))],
        remarks,
    )


def _picture(results: Sequence[Result]) -> Any:
    figure, axes = panels(3, 3.0)
    places = np.arange(len(POSITIONS))
    for j, panel in enumerate(axes):
        for k, source in enumerate(SOURCES):
            values = [_of(results, "error_Nm_Nm_N", f"{source}, {at}")[:, j].mean() for at in POSITIONS]
            panel.bar(places + (k - 1.5) * 0.2, values, 0.18, color=COLORS[k], label=source)
        panel.set_xticks(places, POSITIONS, fontsize=8)
        panel.set_title(AXES[j], fontsize=10)
    legend_below(figure, axes[0], columns=4)
    return figure


EXPERIMENT = Experiment(
    "regressor-identification", "beyond the paper",
    "Gravity parameters of a RAVEN-II from poses that it holds", __doc__,
    cases, report, minutes=13.0,
)  # fmt: skip
