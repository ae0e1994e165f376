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
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture
from papers.figures import legend_below, panels
from papers.kit import cells, grid, rows, sample, table
from papers.regressor.raven_identification import BELIEF, ON, POSITIONS, TRUE, identified

HELD = "held_error_deg_deg_mm"
AXES = ("J1 [Nm]", "J2 [Nm]", "J3 [N]")
SOURCES = (TRUE, BELIEF, *(f"identified on {on}" for on in ON))
COLORS = ("#b8bfc9", "#8a94a3", "#4b6b94", "#d9622b")


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot."""
    poses, sparsities = (2, (1 / 2,)) if scope.quick else (30, (1 / 2, 1 / 3, 1 / 4))
    return grid(identified, {"seed": scope.robots}, poses=poses, sparsities=sparsities)


def torque_error(o: Outcomes, source: str, at: str) -> Floats:
    """Return the RMS error of the gravity torque on another base (robots, 3) [Nm, Nm, N]."""
    return sample(o, identified, "error_Nm_Nm_N", f"{source}, {at}")


def report(o: Outcomes) -> Report:
    """Return torque errors on another base, what poses tell, and PD+DG with what was found."""
    results = o.of(identified)
    counts = results[0]["base_parameters"]
    ranks = [
        [
            label,
            ", ".join(sorted({str(one["ranks"][label]) for one in results})),
            str(counts[label.removeprefix("identified on ").split(",")[0]]),
        ]
        for label in results[0]["ranks"]
    ]

    def held(source: str) -> list[str]:
        shares, errors = (sample(o, identified, what, source) for what in ("pd_share_percent", HELD))
        return [source, *cells(shares, 0), *cells(errors)]

    def off(source: str, at: str) -> list[str]:
        return [source, at, *cells(torque_error(o, source, at))]

    tables = [
        table(
            "Gravity torque at poses on another base, RMS error",
            ["parameters", "positions", *AXES],
            rows(off, SOURCES, POSITIONS),
        ),
        table("What the poses tell", "fit | rank | base parameters", ranks),
        table(
            "PD+DG at static poses on that base, reported positions",
            ["parameters", *(f"PD share J{j} [%]" for j in (1, 2, 3)), "error J1 [deg]", "J2 [deg]", "J3 [mm]"],
            rows(held, SOURCES),
        ),
    ]
    found = [one["identify_Nm_Nm_N"] for one in results]
    remarks = [each for each in found if isinstance(each, str)]
    if told := [each for each in found if not isinstance(each, str)]:
        words = ", ".join(f"{axis} {value}" for axis, value in zip(AXES, cells(np.array(told)), strict=True))
        remarks.append(
            "`identify` (terms static) of the level base's poses with reported positions, at other poses there, RMS "
            f"error: {words}."
        )
    caption = "RMS error of the gravity torque on another base, by positions"
    return Report(tables, [TitledPicture(caption, _picture(o))], remarks)


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.0)
    places = np.arange(len(POSITIONS))
    for j, panel in enumerate(axes):
        for k, source in enumerate(SOURCES):
            values = [torque_error(o, source, at)[:, j].mean() for at in POSITIONS]
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
