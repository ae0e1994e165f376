"""Frequency response of PD with gravity on a moving base, and whether it may swing up: the gravity paper's future work.

Lewis and Hannaford 2014, section VII: "a study of the frequency response of the system with the PD+DG controller could
show a case in which specific perturbations of the base could create a positive feedback instability between the robot
motion and the accelerometer".

The arm is linear about a pose at rest, without friction, which only takes energy; equations stand in coupling.py. The
base rocks about Z0 around 15 deg, or sways along an axis; it stands on a spring of a natural frequency, with a damping
ratio of 0.02, as of bolted steel: sizes that are stable by small gain go with its inverse. Sizes are of base with arm.
Gravity is known not at all (PD; PD+SG, since a constant does not respond); by the last sample of an accelerometer held
at 100 Hz, 10 ms late, as the paper's was; by this package's estimator at 200 Hz, 2 ms late, from an accelerometer or
from an inertial unit. What swings up is counted by the argument principle, from the smallest base that small gain
makes stable down to a base without mass, which leaves the arm alone.
"""

from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import FOUR_COLORS, legend_below, panels
from papers.gravity import coupling
from papers.gravity.raven_base import SHOWN
from papers.kit import graded, table

FREQUENCIES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)  # [Hz]
BASE_HZ = (2.0, 5.0, 10.0, 20.0)
ACCELERATIONS = (1.0, 2.0, 3.0)  # [m/s2] sustained
MOTIONS = {"x": "kg", "y": "kg", "z": "kg", "turn": "kg m2"}  # of the base: along an axis, or about Z0
NONE, HELD, ACCELEROMETER, UNIT = "PD, PD+SG", "DG, held sample 100 Hz", "DG, accelerometer", "DG, IMU"
WAYS = (NONE, HELD, ACCELEROMETER, UNIT)
ALONE = 1.001  # times what the arm weighs: a base below is none
DRAWN_KG, DRAWN_HZ = 50.0, 10.0  # a swaying base whose loop gain is drawn
POINTS = 28  # frequencies at which the estimator is measured


@run(revision=1)
def responses(points: int) -> Result:
    """Measure the estimator at some frequencies, and look through it: joints, loop gain, and bases that swing up.

    Returns:
        `response`: joint 1's error per angle [rad/rad] at FREQUENCIES; `curves` of the picture; `stable` and
        `unstable`: smallest stable and largest unstable size by motion, natural frequency and way of knowing gravity;
        `own`: of the arm alone; `sustained`: what joints lack [Nm, Nm, N] and how far they go [deg, deg, mm].
    """
    sensed, held = coupling.estimator(points=points), coupling.held_sample(100.0, 0.01)
    sensing = (
        coupling.Sensing(coupling.blind, coupling.blind),
        coupling.Sensing(held, coupling.blind),
        coupling.Sensing(sensed.gravity, coupling.blind),
        sensed,
    )
    ways = dict(zip(WAYS, sensing, strict=True))
    turn, sway = coupling.raven_on("turn"), coupling.raven_on("x")
    kept = coupling.GRID[(coupling.GRID >= 0.1) & (coupling.GRID <= 20.0)]
    grid = np.unique(np.concatenate([coupling.GRID[coupling.GRID >= 0.5], np.linspace(9.0, 11.0, 101)]))
    stable: dict[str, dict[str, list[float]]] = {}
    unstable: dict[str, dict[str, list[float]]] = {}
    for motion in MOTIONS:
        arm = coupling.raven_on(motion)
        stable[motion] = {name: [coupling.smallest_base(arm, way, hz) for hz in BASE_HZ] for name, way in ways.items()}
        unstable[motion] = {
            name: [coupling.largest_unstable_base(arm, way, hz) for hz in BASE_HZ] for name, way in ways.items()
        }
    return {
        "response": {
            name: np.abs(coupling.joint_response(turn, FREQUENCIES, way)[:, 0]).tolist() for name, way in ways.items()
        },
        "curves": {
            "rocking_hz": _rounded(kept),
            "joint": {
                name: _rounded(np.abs(coupling.joint_response(turn, kept, way)[:, 0])) for name, way in ways.items()
            },
            "around_hz": _rounded(grid),
            "around": {
                name: _rounded(np.abs(coupling.loop(sway, grid, way, DRAWN_HZ)) / DRAWN_KG)
                for name, way in ways.items()
            },
        },
        "stable": stable,
        "unstable": unstable,
        "own": {motion: coupling.raven_on(motion).own for motion in MOTIONS},
        "sustained": [
            {"acceleration": a, "lacking": (sway.h * a).tolist(), "off": (sway.h * a / sway.kp * SHOWN).tolist()}
            for a in ACCELERATIONS
        ],
    }


def _rounded(values: Floats) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


def cases(scope: Scope) -> list[Case]:
    """Return the one case: the robot is the nominal one, linear."""
    return [responses.case(points=6 if scope.quick else POINTS)]


def report(o: Outcomes) -> Report:
    """Return what joints feel of a base, which bases are stable, which swing up, and the picture."""
    (result,) = o.of(responses)
    own = result["own"]
    felt = [[f"{hz:g}", *(f"{result['response'][name][k]:.5f}" for name in WAYS)] for k, hz in enumerate(FREQUENCIES)]
    pushed = [
        [
            f"{one['acceleration']:g}",
            " ".join(f"{value:+.2f}" for value in one["lacking"]),
            " ".join(f"{value:+.3f}" for value in one["off"]),
            "0",
        ]
        for one in result["sustained"]
    ]
    tables = [
        table("Joint 1's error per angle of a rocking base [rad/rad]", ["rocking [Hz]", *WAYS], felt),
        table("Smallest base that is stable by small gain", ["base", *WAYS], _sizes(result["stable"])),
        table(
            "Largest base that swings up, by the count of unstable roots", ["base", *WAYS], _sizes(result["unstable"])
        ),
        table(
            "Sustained acceleration",
            "along x [m/s2] | lacking [Nm Nm N] | tilt only: J1 J2 J3 off [deg deg mm] | accelerometer",
            pushed,
        ),
    ]
    caption = (
        f"Left: from a rocking base to joint 1. Right: around the loop of a base of {DRAWN_KG:g} kg at {DRAWN_HZ:g} "
        "Hz, swaying along x; below 1 it is stable"
    )
    remark = (
        f"The arm alone is {own['x']:.3g} kg, and {own['turn']:.2g} kg m2 about Z0: no base with arm has less. The "
        f"column {NONE} of the smallest stable base is the arm's own reaction, which is physics and never unstable: "
        "small gain is sufficient, not necessary."
    )
    return Report(tables, {caption: _picture(result["curves"])}, [remark])


def _sizes(sizes: Result) -> list[list[str]]:
    return [
        [
            f"{motion}, {hz:g} Hz",
            *(f"{sizes[motion][name][k]:.3g} {unit}" if sizes[motion][name][k] > 0.0 else "none" for name in WAYS),
        ]
        for motion, unit in MOTIONS.items()
        for k, hz in enumerate(BASE_HZ)
    ]


def _picture(curves: Result) -> Any:
    drawn, (left, right) = panels(2, 3.8)
    for name, color in zip(WAYS, FOUR_COLORS, strict=True):
        # a held sample and the accelerometer through the estimator are nearly the same
        style = "--" if name == ACCELEROMETER else "-"
        left.loglog(curves["rocking_hz"], curves["joint"][name], style, color=color, label=name)
        # a base that sways does not turn: nothing for a gyroscope to add
        right.loglog(curves["around_hz"], curves["around"][name], ":" if name == UNIT else style, color=color)
    left.set_xlabel("base rocks about Z0 [Hz]")
    left.set_ylabel("joint 1's error per base angle [rad/rad]")
    right.axhline(1.0, color="#7a8699", lw=0.8)
    right.annotate("stable below", (0.55, 0.3), fontsize=8, color="#4a5568")
    right.set_xlabel("frequency [Hz]")
    right.set_ylim(1e-9, 10.0)
    right.set_ylabel("gain around the loop [1]")
    legend_below(drawn, left, columns=4)
    return drawn


EXPERIMENT = Experiment(
    "gravity-frequency", "future work", "From a base's motion to joint errors, and back", __doc__,
    cases, report, minutes=0.5, drawn=0,
)  # fmt: skip


@EXPERIMENT.claim(
    "A case exists in which perturbations of the base make an unstable feedback between robot and accelerometer",
    "VII, future work",
    "asked, not answered",
    "the closed loop has unstable roots with an accelerometer alone, on a base that weighs more than nothing beside "
    "the arm; same direction: only on a base without mass, or only with a gyroscope as well",
    "With the accelerometer a heavier base is stable by small gain, or its phase leaves the roots on the left. The "
    "gyroscope swings a light turning base up, as the estimator's lag at its natural frequency adds to the motion.",
)
def _instability(o: Outcomes) -> Judgement:
    result, *_ = o.of(responses)
    swinging = [
        (name, motion, hz, size, size > ALONE * result["own"][motion])
        for motion, by_way in result["unstable"].items()
        for name in (HELD, ACCELEROMETER, UNIT)
        for hz, size in zip(BASE_HZ, by_way[name], strict=True)
        if size > 0.0
    ]
    text = "; ".join(
        f"{name}: {motion}, {hz:g} Hz, up to {size:.2g} {MOTIONS[motion]}{'' if heavier else ', the arm alone'}"
        for name, motion, hz, size, heavier in swinging
    )
    heavy = any(heavier and name != UNIT for name, _, _, _, heavier in swinging)
    return graded(heavy, bool(swinging), text or "no base swings up")
