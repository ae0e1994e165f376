"""The tutorial on mass and gravity, run.

The two-link arm of docs/tutorial-two-link.md under PD control, with and without each term of the model.

T. DeWolf, "Robot control part 3: accounting for mass and gravity": u = M(q) qdd_des + g(q), qdd_des by PD in joint
space. All controllers have the same natural frequency, 5 Hz, and damping ratio, 0.7, on an ideal arm without friction
that moves from -60, 30 to 50, 100 deg and rests: fast, at up to 6 rad/s, for the velocity terms to show, and at a third
of that. The tutorial runs no arm and states no numbers; the motion is ours.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from catenary import GravityPD, InertiaPD, JointState, RobotModel, go_to, inverse_dynamics, load_robot, mass_matrix
from catenary.arrays import Floats
from catenary.control.gains import DAMPING_RATIO, NATURAL_FREQUENCY_HZ, gains_from_mass
from catenary.control.pd import Controller, JointPD
from catenary.spatial import LEVEL
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.kit import by_count, filled, grid, sample, table

TICK = 1e-3  # [s] over which a torque is held, as a 1 kHz loop holds it
START, GOAL = np.deg2rad([-60.0, 30.0]), np.deg2rad([50.0, 100.0])
FASTEST, QUICKEST = 6.0, 30.0  # [rad/s], [rad/s2] at full speed
SPEEDS = {"fast": 1.0, "slow": 1.0 / 3.0}
DRAWN_EVERY = 10  # ticks
FULL = "PD, inertia, gravity"
NAMES = ("PD", "PD, gravity", "PD, inertia", FULL, f"{FULL}, Coriolis")
COLORS = ("#b8c0cc", "#4b6b94", "#8a9a5b", "#d9622b", "#1c2430")


# what holds gravity alone, and inertia besides: by these a joint that should stay is seen to be disturbed or not
BESIDE = ("PD, gravity", FULL)
PLACES = {"start": START, "halfway": 0.5 * (START + GOAL), "goal": GOAL}
STEP = np.deg2rad(2.0)  # small, so that velocity terms hardly count
UNDISTURBED = 0.1  # of the disturbance without the mass matrix


class Run(NamedTuple):
    """A simulated motion."""

    time: Floats  # (T,) [s]
    q: Floats  # (T, n) [rad|m]
    error: Floats  # (T, n) reference minus position
    tau: Floats  # (T, n) [Nm|N]


def simulate(
    model: RobotModel,
    controller: Controller,
    trajectory: Trajectory,
    gravity: Floats = LEVEL,
    start: Floats | None = None,
) -> Run:
    """Let an ideal arm, without friction, with perfect sensors, follow a motion from rest at its begin, or at start.

    M(q) qdd = tau - C(q, qd) qd - g(q), by Runge-Kutta of fourth order over each tick, the torque held. Gravity is in
    base axes [m/s2].
    """
    zero = np.zeros(model.n)

    def rates(q: Floats, qd: Floats, tau: Floats) -> tuple[Floats, Floats]:
        bias = inverse_dynamics(model, q, qd, zero, gravity)
        return qd, np.asarray(np.linalg.solve(mass_matrix(model, q), tau - bias), dtype=np.float64)

    q, qd, tau = trajectory(0.0).q if start is None else start, zero.copy(), zero.copy()
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
    w = 2.0 * np.pi * NATURAL_FREQUENCY_HZ
    acceleration = w * w, 2.0 * DAMPING_RATIO * w
    return {
        "PD": JointPD(kp, kd),
        "PD, gravity": GravityPD(model, kp, kd),
        "PD, inertia": InertiaPD(model, *acceleration, gravity=np.zeros(3)),
        "PD, inertia, gravity": InertiaPD(model, *acceleration),
        "PD, inertia, gravity, Coriolis": InertiaPD(model, *acceleration, coriolis=True),
    }


def motion(speed: float = 1.0) -> InTurn:
    """Return the motion from START to GOAL at a share of full speed, and a rest there."""
    way = go_to(START, GOAL, max_velocity=[speed * FASTEST] * 2, max_acceleration=[speed**2 * QUICKEST] * 2)
    return InTurn([way, Rest(GOAL, 0.7)])


@run(revision=1)
def errors_of(controller: str, speed: float) -> Result:
    """Let the arm follow the motion; return its errors in deg."""
    model = load_robot("two_link")
    ended = simulate(model, controllers(model)[controller], motion(speed))
    error = np.rad2deg(ended.error)
    return {
        "largest_deg": np.abs(error).max(axis=0).tolist(),
        "at_rest_deg": np.abs(error[-1]).tolist(),
        "time_s": np.round(ended.time[::DRAWN_EVERY], 3).tolist(),
        "error_deg": np.round(error[::DRAWN_EVERY], 4).T.tolist(),
    }


@run(revision=1)
def disturbance(controller: str, stepped: int, place: str) -> Result:
    """Let the reference of one joint step; return how far that moves the other, which should stay [deg]."""
    model = load_robot("two_link")
    goal = PLACES[place] + np.where(np.arange(2) == stepped, STEP, 0.0)
    ended = simulate(model, controllers(model)[controller], Rest(goal, 1.0), start=PLACES[place])
    return {"largest_deg": float(np.rad2deg(np.abs(ended.error[:, 1 - stepped]).max()))}


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every controller and speed, and for the disturbance of each joint by the other."""
    coupled = grid(disturbance, {"place": PLACES, "controller": BESIDE, "stepped": (0, 1)})
    if scope.quick:
        return grid(errors_of, {"controller": ("PD", FULL)}, speed=1.0)
    return [*grid(errors_of, {"speed": SPEEDS.values(), "controller": NAMES}), *coupled]


def report(o: Outcomes) -> Report:
    """Return errors by controller and speed, and those of the fast motion over time."""

    def errors(speed: float) -> list[list[str]]:
        return [
            [args["controller"], *(f"{v:.3f}" for key in ("largest_deg", "at_rest_deg") for v in result[key])]
            for args, result in o.items(errors_of, speed=speed)
        ]

    header = "controller | largest error q0 [deg] | q1 [deg] | at rest q0 [deg] | q1 [deg]"
    titles = {f"The {name} motion, up to {speed * FASTEST:g} rad/s": speed for name, speed in SPEEDS.items()}
    tables = filled(table(title, header, errors(speed)) for title, speed in titles.items())
    return Report(tables, {"Errors of both joints over the fast motion": _picture(o)})


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(2, 3.6)
    for args, result in o.items(errors_of, speed=1.0):
        name = args["controller"]
        for panel, error in zip(axes, result["error_deg"], strict=True):
            panel.plot(result["time_s"], error, color=COLORS[NAMES.index(name)], linewidth=1.4, label=name)
    for j, panel in enumerate(axes):
        panel.set_title(f"q{j}", fontsize=10)
        panel.set_xlabel("time [s]")
    axes[0].set_ylabel("error [deg]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _reached(o: Outcomes, controller: str, key: str) -> Floats:
    """Return errors (speeds, 2) [deg]."""
    return np.array([result[key] for result in o.of(errors_of, controller=controller)])


EXPERIMENT = Experiment(
    "tutorial-two-link", "the whole of it", "Mass and gravity of a two-link arm", __doc__,
    cases, report, minutes=1.0, drawn=0,
)  # fmt: skip


@EXPERIMENT.claim(
    "Gravity is cancelled by g(q)",
    "Accounting for gravity",
    "no numbers",
    "with it the arm rests within 0.01 deg of where it should, without it beyond 0.1 deg",
)
def _gravity(o: Outcomes) -> Judgement:
    off = {name: _reached(o, name, "at_rest_deg") for name in NAMES}
    text = ", ".join(f"{name} {values.max():.3f}" for name, values in off.items())
    holds = [
        float(values.max()) < 0.01 if "gravity" in name else float(values.max()) > 0.1 for name, values in off.items()
    ]
    return by_count(holds, f"deg at rest: {text}")


@EXPERIMENT.claim(
    "With the effects of inertia cancelled, joints can be controlled independently",
    "Making a PD controller in joint space",
    "no numbers",
    f"as the reference of one joint steps by {np.rad2deg(STEP):.0f} deg, the other, which should stay, moves less than "
    f"{100.0 * UNDISTURBED:.0f} % as far with M(q) as without, gravity cancelled in both, whichever steps, where the "
    "motion begins, halfway and where it ends; same direction: in more than half of these six",
    "What M leaves are velocity terms of the step itself, the same wherever the arm stands; folded, inertia couples "
    "the joints least, so that the share that is left is largest there.",
)
def _inertia(o: Outcomes) -> Judgement:
    cases = [
        (
            f"{place}, q{j} steps",
            [
                float(sample(o, disturbance, "largest_deg", controller=control, place=place, stepped=j)[0])
                for control in BESIDE
            ],
        )
        for place in PLACES
        for j in range(2)
    ]
    text = "; ".join(f"{name}: {without:.3f} to {with_it:.3f} deg" for name, (without, with_it) in cases)
    return by_count([with_it < UNDISTURBED * without for _, (without, with_it) in cases], f"the other moves, {text}")


@EXPERIMENT.claim(
    "Without the Coriolis terms you will be fine most of the time",
    "closing section",
    "no numbers",
    "at most 1 deg on both joints in both motions; same direction: in more than half of the four",
    f"This arm swings at up to {FASTEST:g} rad/s, and the loop is {NATURAL_FREQUENCY_HZ:g} Hz stiff: the error that "
    "the velocity terms make is their acceleration over the square of that frequency, whatever the loop's rate.",
)
def _coriolis(o: Outcomes) -> Judgement:
    errors = _reached(o, FULL, "largest_deg")
    text = "; ".join(f"{speed}: {errors[k, 0]:.2f}, {errors[k, 1]:.2f} deg" for k, speed in enumerate(SPEEDS))
    return by_count((errors < 1.0).ravel(), text)
