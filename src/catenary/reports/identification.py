"""Identification report (HTML): residuals, measured and predicted torques, masses, rotors, excitation."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.files import json_text
from catenary.identification.identification import Identification, Rotor
from catenary.identification.identification_file import Card
from catenary.identification.samples import Samples
from catenary.reports import page
from catenary.reports.robot_plot import robot_picture
from catenary.tables import Column, Table, joint_columns
from catenary.units import TORQUE_UNIT

_MAX_POINTS = 3000  # rows in a plot
_SHOWN_POSES = 9  # of a recording


def write_identification_report(
    path: Path, result: Identification, card: Card, shown: Sequence[Samples], *, notes: Sequence[str] = ()
) -> None:
    """Write the report of an identification as one self-contained HTML file.

    Args:
        shown: Recordings whose torques are plotted.
    """
    blocks: list[page.Block] = [
        page.Heading("Residuals"),
        result.residual_table,
        page.Text(
            "RMS of measured minus predicted torque over RMS of the torque, per axis, after subtracting known torques. "
            "On a recording that was not fitted the model holds if no axis has more than twice the training residual, "
            "has drifted beyond that, and fails if an axis is hardly better than predicting no torque. The verdict is "
            "unclear for axes that moved too little, or without a fit."
        ),
        absolute_table(result),
        *([page.Remarks(notes)] if notes else []),
        page.Heading("Excitation"),
        page.Facts(excitation_facts(result)),
    ]
    for samples in shown[:1]:  # with the identified masses, if they are per link
        rows = np.linspace(0, len(samples) - 1, _SHOWN_POSES).astype(int)
        caption = f"The robot in {_SHOWN_POSES} poses of {samples.name}, the first of them whole."
        robot = result.model if result.phi is None else result.robot()
        blocks.append(robot_picture(robot, samples.q[rows], caption, gravity=result.options.gravity))
    for samples in shown:
        blocks += [page.Heading(f"Torques of {samples.name}"), torque_picture(result, samples)]
    if (masses := mass_table(result)) is not None:
        blocks += [page.Heading("Links beside the robot's file"), masses]
    if (rotors := rotor_table(result)) is not None:
        blocks += [page.Heading("Rotors"), rotors]
    blocks += [
        page.Heading("Base parameters"),
        result.parameter_table,
        page.Listing("What each stands for", "\n".join(result.base.describe(i) for i in range(result.base.count))),
        page.Listing("The whole card", json_text(card)),
    ]
    what = "poses at rest" if result.options.terms == "static" else "full dynamics"
    count, logs = sum(r.rows for r in result.training), ", ".join(r.log for r in result.training)
    lead = f"{what}: {result.base.count} base parameters from {count:,} rows of {logs}."
    page.write_page(path, f"Identification of {result.model.name}", lead, blocks)


def absolute_table(result: Identification) -> Table:
    """Return the RMS residual per recording and axis in Nm and N."""
    units = [TORQUE_UNIT[unit] for unit in result.model.joint_units]
    joints = list(zip(result.model.joint_names, units, strict=True))
    columns = [("RMS residual", "log"), *joint_columns(joints, lambda r, j: r.rms[j], ".4f")]
    return Table(columns, [*result.training, *result.tests], "RMS residual")


def mass_table(result: Identification) -> Table | None:
    """Return a table of identified masses and centres of mass beside those of the robot's file; None without them."""
    if not result.prior or result.phi is None:
        return None
    robot, described = result.robot(), result.model
    columns: list[Column] = ["link", ("mass [kg]", ":.3g"), ("file's [kg]", ":.3g"), ("ratio", ":.2f")]
    columns.append(("distance of centres [mm]", ":.0f"))
    links = [i for i in result.base.parameters.links if described.tree.mass[i] > 0.0]
    mass, own = robot.tree.mass[links], described.tree.mass[links]
    apart = 1000.0 * np.linalg.norm(robot.tree.com[links] - described.tree.com[links], axis=1)
    rows = list(zip((described.link_names[i] for i in links), mass, own, mass / own, apart, strict=True))
    return Table(columns, rows, "Links beside the robot's file; single masses are regularised to it, not measured")


def rotor_table(result: Identification) -> Table | None:
    """Return a table of reflected rotor inertias; None without rotors."""

    def source(rotor: Rotor) -> str:
        return "as stated" if result.options.rotors else "by itself" if rotor.error is not None else "with its link's"

    columns: list[Column] = [("rotor", "name"), ("reflected inertia [kg m2, kg]", "inertia:.3g")]
    columns += [("std", "error:.2g"), ("identified", source)]
    return Table(columns, result.rotors, "Rotors, reflected to the joints") if result.rotors else None


def excitation_facts(result: Identification) -> list[tuple[str, str]]:
    """Return rank, condition, weights and physical consistency, as name and text."""
    consistent = "not requested" if result.phi is None else "yes: every link a body, no negative friction"
    return [
        ("rank", f"{result.rank} of {result.base.count} base parameters"),
        ("condition", f"{result.condition:.4g} (weighted rows, columns scaled to length one)"),
        ("weights of the axes", ", ".join(f"{w:.4g}" for w in result.weights)),
        ("physically consistent", consistent),
    ]


def torque_picture(result: Identification, samples: Samples) -> page.Picture:
    """Plot measured and predicted torque of every axis over time."""
    every = max(1, len(samples) // _MAX_POINTS)
    tau, time = samples.tau[::every], samples.time[::every]
    predicted = result.predict_samples(samples)[::every]
    units = [TORQUE_UNIT[unit] for unit in result.model.joint_units]
    figure, panels = page.joint_panels(list(zip(result.model.joint_names, units, strict=True)), 1.7)
    for i, (axis,) in enumerate(panels):
        for values, colour, label in (
            (tau[:, i], page.GREY, "measured"),
            (predicted[:, i], page.ORANGE, "predicted"),
            (tau[:, i] - predicted[:, i], page.BLUE, "residual"),
        ):
            axis.plot(time, values, color=colour, linewidth=0.8, label=label)
    panels[0, 0].legend(loc="upper right", ncols=3, fontsize=8)
    axis.set_xlabel("row" if result.options.terms == "static" else "time [s]")
    return page.picture(figure, "Measured torque, predicted torque and residual, with the same filter.")
