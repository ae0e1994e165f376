"""Calibrated joints inside the gravity model, and gravity inside the calibration.

A linear model of the positioning joints is trained level on zig-zags at 1/2, 1/3 and 1/4; then the robot, not homed
anew, follows 30 s of random motion in the calibrated box by PD+DG, level, at 20 deg about Z0 and rocking, and is held
by gravity compensation alone at five base angles. The gravity model, or the whole control, takes reported or calibrated
joints: calibrated by the model's zeros, and once by the rig's. In the whole control the calibration's input torque is
what the control has just asked for; so there is one without valid range, and one that takes positions alone. Damping
is relative to the reference's velocity.

The other way round, models trained level or on several tilts take the robot's torque less the gravity model's in place
of the torque itself; conditions and raw torque are those of calibration on tilted and rocking bases.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.beyond import tilted_calibration as tilted
from papers.beyond.bases import BASES, LEVEL_BASE, ROCKING
from papers.beyond.calibrated_gravity import CONTROLLERS, HOLDS, INSIDE, REPORTED, RIG, STILL, control, held
from papers.calibration.recordings import SPARSITIES
from papers.claims import mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture, TitledTable
from papers.figures import legend_below, panels
from papers.kit import JOINTS, UNITS

CONTROL_BASES = (LEVEL_BASE, tilted.TILTED, ROCKING)
ANGLES_DEG = (0.0, 20.0, 45.0, 90.0, 180.0)
SECONDS, HOLD_SECONDS = 30.0, 5.0
TRAININGS = (tilted.LEVEL, tilted.SEVERAL)
TORQUES = {tilted.PAPERS: "raw torque", tilted.LESS_GRAVITY: "torque less gravity"}
NEWTONS = ("Nm", "Nm", "N")
COLORS = dict(zip(CONTROLLERS, ("#8a94a3", "#2f8f6b", "#b8bfc9", "#c9a227", "#d9622b", "#4b6b94"), strict=True))
DRAWN = (REPORTED, INSIDE, STILL, RIG)


def cases(scope: Scope) -> list[Case]:
    """Return cases of control and holding by robot, and of calibration by robot, training and torque."""
    sparsities: Sequence[float] = (1.0,) if scope.quick else SPARSITIES
    seconds, held_s = (2.5, 0.5) if scope.quick else (SECONDS, HOLD_SECONDS)
    made = []
    for seed in scope.robots:
        made += [
            control.case(seed=seed, base=base, sparsities=sparsities, seconds=seconds)
            for base in (CONTROL_BASES[1:2] if scope.quick else CONTROL_BASES)
        ]
        angles = ANGLES_DEG[:1] if scope.quick else ANGLES_DEG
        made.append(held.case(seed=seed, angles_deg=angles, sparsities=sparsities, seconds=held_s))
        made += [
            tilted.case(seed, training, torque, scope)
            for training in (TRAININGS[:1] if scope.quick else TRAININGS)
            for torque in TORQUES
        ]
    return made


def measured(o: Outcomes, base: str, controller: str, what: str) -> Floats:
    """Return a measure of tracking on every joint, (robots, 3)."""
    found = [result[controller][what] for result in o.of(control, base=base)]
    return np.array(found) if found else np.zeros((0, 3))


def drift(o: Outcomes, controller: str) -> dict[float, Floats]:
    """Return by base angle [deg] how far held joints went, (robots, 3) [deg, deg, mm]."""
    angles = [a for told, _ in o.items(held) for a in told["angles_deg"]]
    return {
        angle: np.array(
            [
                result[controller][told["angles_deg"].index(angle)]
                for told, result in o.items(held)
                if angle in told["angles_deg"]
            ]
        )
        for angle in dict.fromkeys(angles)
    }


def report(o: Outcomes) -> Report:
    """Return tables of tracking, holding and calibration, the picture, and what they come to."""
    tables = [TitledTable("PD+DG along random motion in the calibrated box, RMS", _tracking(o))]
    tables.append(TitledTable("Gravity compensation alone: largest drift, mean of robots (greatest)", _holding(o)))
    tables.append(TitledTable("RMSE of models by the torque among their inputs", _calibration(o)))
    caption = (
        "Left: what the gravity model is wrong by against the true joints. Middle: true tracking error. Both on every "
        "base, mean over robots. Right: RMSE of joint 1 on every base by the torque among the inputs"
    )
    return Report(tables, [TitledPicture(caption, _picture(o))], _remarks(o))


def _tracking(o: Outcomes) -> Table:
    rows = []
    for base in CONTROL_BASES:
        for name in CONTROLLERS:
            if not len(measured(o, base, name, "true")):
                continue
            cells = [base, name]
            for what, digits in (("pd_share", 1), ("reported", 3), ("true", 3), ("gravity", 3)):
                values = measured(o, base, name, what)
                cells += ["; ".join(mean_and_spread(column, digits) for column in values.T)]
            outside = measured(o, base, name, "outside")
            rows.append([*cells, f"{100.0 * outside.max(axis=1).mean():.0f}"])
    header = ["base", "joints", "PD share J1; J2; J3 [%]", "reported error [deg; deg; mm]"]
    header += ["true error [deg; deg; mm]", "gravity wrong by [Nm; Nm; N]", "outside valid range [%]"]
    return Table(header, rows)


def _holding(o: Outcomes) -> Table:
    rows = []
    for angle in drift(o, REPORTED):
        cells = [f"{angle:.0f}"]
        for name in HOLDS:
            values = drift(o, name)[angle]
            cells.append("; ".join(f"{v.mean():.3f} ({v.max():.3f}) {u}" for v, u in zip(values.T, UNITS, strict=True)))
        rows.append(cells)
    return Table(["base about Z0 [deg]", *HOLDS], rows)


def _calibration(o: Outcomes) -> Table:
    rows = []
    for training in TRAININGS:
        for torque in TORQUES:
            for model in tilted.KINDS:
                cells = [tilted.errors(o, training, torque, base, model) for base in BASES]
                if any(len(cell) for cell in cells):
                    told = ["; ".join(mean_and_spread(column) for column in cell.T) for cell in cells]
                    rows.append([training, TORQUES[torque], model, *told])
    units = "; ".join(f"{joint} {unit}" for joint, unit in zip(JOINTS, UNITS, strict=True))
    return Table(["trained", "torque", "model", *(f"{base} [{units}]" for base in BASES)], rows)


def _mean(o: Outcomes, controller: str, what: str) -> Floats:
    """Return a measure's mean over bases and robots, (3,)."""
    rows = [measured(o, base, controller, what) for base in CONTROL_BASES]
    return np.asarray(np.concatenate(rows).mean(axis=0))


def _remarks(o: Outcomes) -> list[str]:
    told = []
    if any(len(measured(o, base, REPORTED, "true")) for base in CONTROL_BASES):

        def joints(controller: str, what: str, digits: int = 3) -> str:
            return "/".join(f"{value:.{digits}f}" for value in _mean(o, controller, what))

        told.append(
            f"With calibrated joints the gravity model is wrong by {joints(INSIDE, 'gravity')} Nm/Nm/N in place of "
            f"{joints(REPORTED, 'gravity')}, and PD's share goes from {joints(REPORTED, 'pd_share', 1)} to "
            f"{joints(INSIDE, 'pd_share', 1)} %; where PD, too, takes joints calibrated by positions alone, the true "
            f"error goes from {joints(REPORTED, 'true')} to {joints(STILL, 'true')} deg/deg/mm."
        )
    raw, less = (
        [tilted.errors(o, tilted.LEVEL, torque, base, "linear") for base in BASES if base != LEVEL_BASE]
        for torque in TORQUES
    )
    if all(len(each) for each in (*raw, *less)):
        parts = ["/".join(f"{v:.3f}" for v in np.concatenate(each).mean(axis=0)) for each in (raw, less)]
        told.append(
            f"A linear model calibrated level errs on tilted and rocking bases by {parts[0]} deg/deg/mm with the "
            f"robot's torque among its inputs, and by {parts[1]} with that torque less the gravity model's."
        )
    return told


def _picture(o: Outcomes) -> Any:
    figure, (wrong, error, calibrated) = panels(3, 3.6)
    for panel, what in ((wrong, "gravity"), (error, "true")):
        for k, name in enumerate(DRAWN):
            rows = [measured(o, base, name, what) for base in CONTROL_BASES]
            values = np.concatenate(rows)
            if len(values):
                places = np.arange(3) + 0.2 * (k - 1.5)
                panel.bar(places, values.mean(axis=0), 0.18, color=COLORS[name], label=name)
        units = NEWTONS if what == "gravity" else UNITS
        panel.set_xticks(range(3), [f"{j} [{u}]" for j, u in zip(JOINTS, units, strict=True)])
    wrong.set_title("gravity model wrong by, RMS", fontsize=10)
    error.set_title("true tracking error, RMS", fontsize=10)
    for k, (torque, color) in enumerate(zip(TORQUES, ("#8a94a3", "#d9622b"), strict=True)):
        for i, training in enumerate(TRAININGS):
            found = [tilted.errors(o, training, torque, base, "linear")[:, 0] for base in BASES]
            if all(len(each) for each in found):
                calibrated.bar(
                    np.arange(len(BASES)) + 0.2 * (2 * i + k - 1.5),
                    [each.mean() for each in found],
                    0.18,
                    color=color,
                    alpha=1.0 if i == 0 else 0.55,
                    label=f"{TORQUES[torque]}, {training}",
                )
    calibrated.set_xticks(range(len(BASES)), BASES, rotation=35, fontsize=8, ha="right")
    calibrated.set_title("linear model, RMSE of J1 [deg]", fontsize=10)
    legend_below(figure, error, calibrated, columns=4)
    return figure


EXPERIMENT = Experiment(
    "beyond-calibration-and-gravity", "beyond both",
    "Calibrated joints inside the gravity model, and gravity inside the calibration", __doc__,
    cases, report, minutes=18.0,
)  # fmt: skip
