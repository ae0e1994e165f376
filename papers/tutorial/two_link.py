"""The two-link arm of docs/tutorial-two-link.md under PD control, with and without each term of the model.

T. DeWolf, "Robot control part 3: accounting for mass and gravity". Run it with `make tutorial`; it writes
tutorial_two_link.svg and prints the table of that page.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import (
    GravityPD,
    InertiaPD,
    JointPD,
    JointState,
    RobotModel,
    go_to,
    inverse_dynamics,
    load_robot,
    mass_matrix,
)
from catenary.arrays import Floats
from catenary.control.controller import Controller
from catenary.control.gains import DAMPING_RATIO, FREQUENCY_HZ, gains_from_mass
from catenary.spatial import LEVEL
from catenary.trajectories.in_turn import InTurn, Rest
from catenary.trajectories.reference import Trajectory
from papers.arguments import folder_argument

TICK = 1e-3  # [s] over which a torque is held, as a 1 kHz loop holds it
START, GOAL = np.deg2rad([-60.0, 30.0]), np.deg2rad([50.0, 100.0])
FASTEST, QUICKEST = 6.0, 30.0  # [rad/s], [rad/s2]: fast enough for the velocity terms to show


class Run(NamedTuple):
    """A simulated motion."""

    time: Floats  # (T,) [s]
    q: Floats  # (T, n) [rad|m]
    error: Floats  # (T, n) reference minus position
    tau: Floats  # (T, n) [Nm|N]


def simulate(
    model: RobotModel, controller: Controller, trajectory: Trajectory, gravity: Floats = LEVEL
) -> Run:
    """Let an ideal arm, without friction and with perfect sensors, follow a motion from its start.

    M(q) qdd = tau - C(q, qd) qd - g(q), by Runge-Kutta of fourth order over each tick, the torque held.

    Args:
        model: With inertia.
        controller: Of its joints.
        trajectory: Of its joints.
        gravity: (3,) in base axes [m/s2].
    """
    zero = np.zeros(model.n)

    def rates(q: Floats, qd: Floats, tau: Floats) -> tuple[Floats, Floats]:
        bias = inverse_dynamics(model, q, qd, zero, gravity)
        return qd, np.asarray(np.linalg.solve(mass_matrix(model, q), tau - bias), dtype=np.float64)

    q, qd, tau = trajectory(0.0).q, zero.copy(), zero.copy()
    rows = []
    for k in range(round(trajectory.duration / TICK) + 1):
        reference = trajectory(k * TICK)
        state = JointState(k * TICK, q.copy(), qd.copy(), tau, np.zeros(0), gravity.copy(), 0.0)
        tau = controller.torque(state, reference)
        rows.append((k * TICK, q, reference.q - q, tau))
        v1, a1 = rates(q, qd, tau)
        v2, a2 = rates(q + 0.5 * TICK * v1, qd + 0.5 * TICK * a1, tau)
        v3, a3 = rates(q + 0.5 * TICK * v2, qd + 0.5 * TICK * a2, tau)
        v4, a4 = rates(q + TICK * v3, qd + TICK * a3, tau)
        q = q + TICK / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
        qd = qd + TICK / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return Run(*(np.array(column) for column in zip(*rows, strict=True)))


def controllers(model: RobotModel) -> dict[str, Controller]:
    """Return the tutorial's controller, term by term; all have the same natural frequency and damping."""
    kp, kd = gains_from_mass(model)
    w = 2.0 * np.pi * FREQUENCY_HZ
    acceleration = w * w, 2.0 * DAMPING_RATIO * w
    return {
        "PD": JointPD(kp, kd),
        "PD, gravity": GravityPD(model, kp, kd),
        "PD, inertia": InertiaPD(model, *acceleration, gravity=np.zeros(3)),
        "PD, inertia, gravity": InertiaPD(model, *acceleration),
        "PD, inertia, gravity, Coriolis": InertiaPD(model, *acceleration, coriolis=True),
    }


def motion() -> InTurn:
    """Return the motion from START to GOAL, and a rest there."""
    way = go_to(START, GOAL, max_velocity=[FASTEST] * 2, max_acceleration=[QUICKEST] * 2)
    return InTurn([way, Rest(GOAL, 0.7)])


def write_picture(path: Path, runs: Mapping[str, Run]) -> None:
    """Draw the errors of both joints over time into an SVG file."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    # the same numbers give the same file
    with rc_context({"svg.hashsalt": "catenary", "svg.fonttype": "none", "path.simplify_threshold": 0.5}):
        figure = Figure(figsize=(9, 3.4), layout="constrained")
        colors = ["#b8c0cc", "#4b6b94", "#8a9a5b", "#d9622b", "#1c2430"]
        for j, axes in enumerate(figure.subplots(1, 2)):
            for (name, run), color in zip(runs.items(), colors, strict=True):
                error = np.rad2deg(run.error[::10, j])
                axes.plot(run.time[::10], error, color=color, linewidth=1.4, label=name)
            axes.set_title(f"q{j}", fontsize=10)
            axes.set_xlabel("time [s]")
            axes.spines[["top", "right"]].set_visible(False)
        figure.axes[0].set_ylabel("error [deg]")
        figure.legend(
            *figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
        )
        figure.savefig(path, format="svg", metadata={"Date": None})


def main(folder: Path) -> dict[str, Run]:
    """Run every controller, print the table, write the picture."""
    model = load_robot("two_link")
    runs = {name: simulate(model, controller, motion()) for name, controller in controllers(model).items()}
    print(
        "| controller | largest error q0 [deg] | q1 [deg] | at rest q0 [deg] | q1 [deg] |\n|---|---|---|---|---|"
    )
    for name, run in runs.items():
        most, last = np.rad2deg(np.abs(run.error).max(axis=0)), np.rad2deg(np.abs(run.error[-1]))
        print(f"| {name} | {most[0]:.3f} | {most[1]:.3f} | {last[0]:.3f} | {last[1]:.3f} |")
    folder.mkdir(parents=True, exist_ok=True)
    write_picture(folder / "tutorial_two_link.svg", runs)
    return runs


if __name__ == "__main__":
    main(folder_argument(__doc__))
