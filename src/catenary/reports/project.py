"""Project report (HTML): recorded motion, errors before and after calibration, latency in the loop, card."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary.calibration.evaluate import Evaluation, percent
from catenary.calibration.model import CalibrationModel, Card
from catenary.plant import MotionLog
from catenary.reports.calibration import write_calibration_report
from catenary.reports.page import BLUE, Block, Heading, Picture, Text, picture
from catenary.tables import Column, Table
from catenary.units import DISPLAY

_TEST_COLOR = "#d9a441"
_MAX_POINTS = 6_000  # of a recording in a plot


def write_project_report(
    path: Path,
    connection: str,
    model: CalibrationModel,
    card: Card,
    evaluations: Mapping[str, Evaluation],
    train: Sequence[MotionLog],
    test: Sequence[MotionLog],
    deployment: Mapping[str, Any] | None,
    *,
    notes: Sequence[str] = (),
) -> None:
    """Write the report of a project for the model of the last evaluation.

    Args:
        connection: "simulation", "ros1" or "ros2".
        evaluations: By model, the recommended one last.
    """
    name, evaluation = list(evaluations.items())[-1]
    opening: list[Block] = [Heading("What the robot did"), _coverage(train, test)]
    further: list[Block] = []
    if deployment is not None:
        further = [Heading("Deployed in the 1 kHz loop"), *_deployment_blocks(deployment, connection)]
    opening += [Heading("Every model"), comparison_table(evaluations)]
    write_calibration_report(
        path, model, card, evaluation, tested_on=", ".join(log.name for log in test), notes=notes,
        opening=opening, further=further, name=name,
    )  # fmt: skip


def comparison_table(evaluations: Mapping[str, Evaluation], title: str = "") -> Table:
    """Return a table with a row for each model, after raw errors and those of the fixed offset.

    Args:
        evaluations: By name of the model, all on the same rows.
    """
    joints = next(iter(evaluations.values())).joints
    rows = [
        ["raw", *(f"{joint.raw_rmse:.3f}" for joint in joints)],
        ["fixed offset", *(f"{joint.offset_rmse:.3f} (100 %)" for joint in joints)],
    ]
    for name, evaluation in evaluations.items():
        cells = (f"{j.rmse:.3f} ({percent(j.percent_of_offset, 0)})" for j in evaluation.joints)
        rows.append([shown_name(name), *cells])
    header = ["model", *(f"{joint.name} [{joint.unit}]" for joint in joints)]
    return Table(header, rows, title)


def shown_name(model: str) -> str:
    """Return a model's name as readable text."""
    return model.replace("_", ", preset ")


def _deployment_blocks(deployment: Mapping[str, Any], connection: str) -> list[Block]:
    if connection == "simulation":
        aside, reference = "the simulated arm's own step", "the joints' true positions"
    else:
        aside, reference = "the way to the robot and back", "the external encoders' latest reading"
    names = {"compute_us": "whole tick", "correction_us": "of it the correction", "jitter_us": "period off its length"}
    headings = {"median": "median", "p99": "99 % below", "p999": "99.9 % below", "max": "largest"}
    in_tick: list[Column] = [("time in each tick", "what")]
    in_tick += [(f"{heading} [us]", f"{key}:.1f") for key, heading in headings.items()]
    # not counted if another process keeps time
    overruns = "" if deployment["overruns"] is None else f", {deployment['overruns']} overruns"
    priority = "with" if deployment["real_time_priority"] else "without"
    return [
        Text(
            f"{deployment['ticks']:,} ticks at {deployment['rate_hz']:g} Hz, {priority} real-time "
            f"priority{overruns}. A whole tick reads the arm, corrects, evaluates the trajectory and "
            f"commands the arm, without {aside}. The correction was timed within the same ticks. Period off its "
            "length: difference of the time between ticks from the requested one."
        ),
        Table(in_tick, [{"what": what, **deployment[key]} for key, what in names.items() if deployment[key]]),
        Text(f"RMS error against {reference} while the loop ran, as reported and as corrected in the tick:"),
        deployed_table(deployment, outside=True),
    ]


def corrector_time(deployment: Mapping[str, Any]) -> list[str]:
    """Return a line on the computation time of a deployed model in each tick, if it was timed."""
    took = deployment["correction_us"]
    return [] if took is None else [f"the corrector takes {took['median']:.1f} us a tick (p99.9 {took['p999']:.0f} us)"]


def deployed_table(deployment: Mapping[str, Any], *, title: str = "", outside: bool = False) -> Table:
    """Return a table of a deployed model's RMS errors and coverage, per joint.

    Args:
        outside: Include the share of ticks outside the model's valid range.
    """
    columns: list[Column] = [("joint", "name"), "unit", ("reported", "raw_rmse:.3f"), ("corrected", "rmse:.3f")]
    if outside:
        columns.append(("outside [% of ticks]", "outside_valid_range:.1%"))
    if deployment["coverage_asked"] is not None:
        columns.append((f"within intervals ({deployment['coverage_asked']:.0%} asked)", "coverage:.0%"))
    return Table(columns, deployment["joints"], title)


def _coverage(train: Sequence[MotionLog], test: Sequence[MotionLog]) -> Picture:
    """Plot training and test motion in joint space, for each pair of the first three joints."""
    from matplotlib.figure import Figure

    first = train[0]
    n = min(3, len(first.joint_names))
    scale = np.array([DISPLAY[unit][1] for unit in first.joint_units])
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)] or [(0, 0)]
    figure = Figure(figsize=(3.4 * len(pairs), 3.3), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(pairs)))
    for ax, (i, j) in zip(axes, pairs, strict=True):
        for logs, color, label in ((test, _TEST_COLOR, "test"), (train, BLUE, "training")):
            points = scale * np.concatenate([log.q_nominal for log in logs])
            x, y = points[:: max(1, len(points) // _MAX_POINTS), [i, j]].T
            ax.plot(x, y, ".", markersize=1.5, color=color, alpha=0.6, label=label)
        for axis, joint in ((ax.set_xlabel, i), (ax.set_ylabel, j)):
            axis(f"{first.joint_names[joint]} [{DISPLAY[first.joint_units[joint]][0]}]")
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, markerscale=6, frameon=False, fontsize=9)
    caption = "Training and test motion in joint space, as reported by the robot."
    return picture(figure, caption)
