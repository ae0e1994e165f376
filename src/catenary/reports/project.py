"""The page of a project: what the robot did, errors before and after, the paper's table beside ours, latency, card."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary.calibration.evaluate import Evaluation
from catenary.calibration.model import CalibrationModel, Card
from catenary.plant import MotionLog
from catenary.reports.calibration import write_calibration_report
from catenary.reports.joint_errors import percent
from catenary.reports.page import Block, Column, Heading, Picture, Table, Text, picture
from catenary.units import DISPLAY

TRAIN_COLOR, TEST_COLOR = "#4b6b94", "#d9a441"
MOST_POINTS = 6_000
PAPER_INPUTS = 16  # of all its models: positions and torques of an arm's eight channels, one of them unused
PAPER_COLUMNS = tuple(f"paper, {PAPER_INPUTS} inputs: {joint}" for joint in ("J1 [deg]", "J2 [deg]", "J3 [mm]"))
# Peng et al. 2024 (`reports.calibration.PAPER`), table I: a real RAVEN-II, trained on zig-zags in direction J2-J3
# (1013 s), tested on 20 minutes of random motion; RMSE on J1 [deg], J2 [deg], J3 [mm]
TABLE_1: dict[str, tuple[float, float, float]] = {
    "raw": (2.103, 7.963, 11.715),
    "fixed offset": (0.859, 1.095, 0.492),
    "linear": (0.174, 0.186, 0.166),
    "polynomial": (0.118, 0.222, 0.173),
    "neural, preset paper": (0.104, 0.120, 0.118),
}


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
    inputs: Mapping[str, Sequence[int]] | None = None,
) -> None:
    """Write the page of a project, of the last evaluation's model; `connection` is "simulation", "ros1" or "ros2"."""
    name, evaluation = list(evaluations.items())[-1]
    opening: list[Block] = [Heading("What the robot did"), _coverage(train, test)]
    further: list[Block] = []
    where = None
    if deployment is not None:
        where = _where(connection, any(s.simulated for s in evaluation.data.sources))
        further = [Heading("Deployed in the 1 kHz loop"), *_deployment_blocks(deployment, connection)]
    opening += [Heading("Every model"), comparison_table(evaluations, inputs=inputs, beside_paper=where)]
    write_calibration_report(
        path, model, card, evaluation, tested_on=", ".join(log.name for log in test), notes=notes,
        opening=opening, further=further, name=name,
    )  # fmt: skip


def comparison_table(
    evaluations: Mapping[str, Evaluation],
    title: str = "",
    *,
    inputs: Mapping[str, Sequence[int]] | None = None,
    beside_paper: str | None = None,
) -> Table:
    """Return a row for each model, after raw errors and the fixed offset's; `beside_paper` adds the paper's table I."""
    joints = next(iter(evaluations.values())).joints
    rows = [
        ["raw", *(f"{joint.raw_rmse:.3f}" for joint in joints)],
        ["fixed offset", *(f"{joint.offset_rmse:.3f} (100 %)" for joint in joints)],
    ]
    for name, evaluation in evaluations.items():
        cells = (f"{j.rmse:.3f} ({percent(j.percent_of_offset, 0)})" for j in evaluation.joints)
        rows.append([shown_name(name), *cells])
    header = ["model", *(f"{joint.name} [{joint.unit}]" for joint in joints)]
    if inputs is not None:
        told = {shown_name(name): "/".join(map(str, dict.fromkeys(counts))) for name, counts in inputs.items()}
        header.insert(1, "inputs")
        rows = [[name, told.get(name, "-"), *cells] for name, *cells in rows]
    if beside_paper is not None:
        header = [f"{header[0]} ({beside_paper})", *header[1:], *PAPER_COLUMNS]
        paper = {name: [f"{value:.3f}" for value in errors] for name, errors in TABLE_1.items()}
        rows = [[*row, *paper.get(row[0], ["-"] * 3)] for row in rows]
    return Table(header, rows, title)


def shown_name(model: str) -> str:
    """Return a model's name as people read it."""
    return model.replace("_", ", preset ")


def _where(connection: str, simulated: bool) -> str:
    """Return what our numbers are of, beside the paper's robot."""
    if connection == "simulation":
        return "simulated"
    network = connection.replace("ros", "ROS ")
    return f"simulated, over {network}" if simulated else f"robot over {network}"


def _deployment_blocks(deployment: Mapping[str, Any], connection: str) -> list[Block]:
    if connection == "simulation":
        aside, reference = "the simulated arm's own step", "the joints' true positions"
    else:
        aside, reference = "the way to the robot and back", "the external encoders' latest reading"
    names = {"compute_us": "whole tick", "correction_us": "of it the correction", "jitter_us": "period off its length"}
    headings = {"median": "median", "p99": "99 % below", "p999": "99.9 % below", "max": "largest"}
    in_tick: list[Column] = [("time in each tick", "what")]
    in_tick += [(f"{heading} [us]", f"{key}:.1f") for key, heading in headings.items()]
    # nobody counts them where time is not kept by this loop
    overruns = "" if deployment["overruns"] is None else f", {deployment['overruns']} overruns"
    priority = "with" if deployment["real_time_priority"] else "without"
    return [
        Text(
            f"{deployment['ticks']:,} ticks at {deployment['rate_hz']:g} Hz, {priority} real-time "
            f"priority{overruns}. A whole tick reads the arm, corrects, evaluates the trajectory and "
            f"commands the arm; {aside} is not in it. The correction was timed within the same ticks. Period off its "
            "length: by how much the time from tick to tick differs from the one asked for."
        ),
        Table(in_tick, [{"what": what, **deployment[key]} for key, what in names.items() if deployment[key]]),
        Text(f"RMS error against {reference} while the loop ran, as reported and as corrected in the tick:"),
        deployed_table(deployment, outside=True),
    ]


def corrector_time(deployment: Mapping[str, Any]) -> list[str]:
    """Return a line on what a deployed model takes of each tick, where that was timed."""
    took = deployment["correction_us"]
    return [] if took is None else [f"the corrector takes {took['median']:.1f} us a tick (p99.9 {took['p999']:.0f} us)"]


def deployed_table(deployment: Mapping[str, Any], *, title: str = "", outside: bool = False) -> Table:
    """Return a deployed model's RMS errors by joint, share within intervals and, with `outside`, outside its range."""
    columns: list[Column] = [("joint", "name"), "unit", ("reported", "raw_rmse:.3f"), ("corrected", "rmse:.3f")]
    if outside:
        columns.append(("outside [% of ticks]", "outside_valid_range:.1%"))
    if deployment["coverage_asked"] is not None:
        columns.append((f"within intervals ({deployment['coverage_asked']:.0%} asked)", "coverage:.0%"))
    return Table(columns, deployment["joints"], title)


def _coverage(train: Sequence[MotionLog], test: Sequence[MotionLog]) -> Picture:
    """Draw where the training and the test motion went, for each pair of the first three joints."""
    from matplotlib.figure import Figure

    first = train[0]
    n = min(3, len(first.joint_names))
    scale = np.array([DISPLAY[unit][1] for unit in first.joint_units])
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)] or [(0, 0)]
    figure = Figure(figsize=(3.4 * len(pairs), 3.3), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(pairs)))
    for ax, (i, j) in zip(axes, pairs, strict=True):
        for logs, color, label in ((test, TEST_COLOR, "test"), (train, TRAIN_COLOR, "training")):
            points = scale * np.concatenate([log.q_nominal for log in logs])
            x, y = points[:: max(1, len(points) // MOST_POINTS), [i, j]].T
            ax.plot(x, y, ".", markersize=1.5, color=color, alpha=0.6, label=label)
        for axis, joint in ((ax.set_xlabel, i), (ax.set_ylabel, j)):
            axis(f"{first.joint_names[joint]} [{DISPLAY[first.joint_units[joint]][0]}]")
    handles, labels = axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2, markerscale=6, frameon=False, fontsize=9)
    caption = "Where the joints went, as the robot reported: training and test motion in joint space."
    return picture(figure, caption)
