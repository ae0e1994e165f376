"""Figures 4 and 5 of the gravity-regressor paper: an upper body of 19 joints learns its gravity, simulated in MuJoCo.

The paper's timeline at 1 kHz: approach 0.2-7 s, estimation 7-12 s, homing 12-17 s, approach one 17-21 s, approach two
22-26 s, homing 27-31 s. PD alone (figure 4) against PD + estimated gravity (figure 5), the error of each joint of
trunk, left arm and right arm. Beyond the paper: from wrong parameters, and with 2 kg that the right hand takes up in
the pose of approach one, unknown to all controllers; and recursive least squares beside the paper's law.

Choices where the paper is silent: the poses (below); gains that let PD alone sag by some tenths of a degree ("quite
huge", the paper says of its own), with rotors in the drives, without which a wrist of 1 g m2 bears no such gains at
1 kHz. The paper's protocol, "as printed": estimation from 7 to 12 s, damping -Kd qd. It does not say whether Z was the
full or the compact one, and of s_0 that it "is assumed to be zero": both forms and both starts are run. Ours
estimates all the time, holding still by itself while the arm moves, and damps the velocity's error.

Run it with `make dual-arm`; it writes dual_arm.json and dual_arm.html and prints the tables.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from catenary import (
    EstimatedGravityPD,
    GravityEstimator,
    JointPD,
    MujocoPlant,
    RobotModel,
    compact_regressor,
    load_robot,
    mass_matrix,
    run_loop,
)
from catenary.arrays import Floats
from catenary.control.controller import Controller
from catenary.control.loop import Tick
from catenary.gravity.estimator import Form
from catenary.gravity.payload import Payload
from catenary.gravity.recursive_estimator import RecursiveGravityEstimator
from catenary.gravity.regressor import gravity_parameters
from catenary.plant import JointState
from catenary.simulation.joint_hardware import JointHardware
from catenary.trajectories.smoothed_path import SmoothedPath
from papers.arguments import folder_argument

# printed: as the paper prints it, damping -Kd qd, and estimation from 7 to 12 s on the compact or the full Z
ControllerName = Literal["pd", "law", "rls", "printed-pd", "printed-compact", "printed-full"]
Start = Literal["zero", "wrong"]
LABELS = {
    "pd": "PD alone",
    "law": "PD + the paper's law",
    "rls": "PD + least squares",
    "printed-pd": "as printed: PD alone",
    "printed-compact": "as printed: law on the compact Z",
    "printed-full": "as printed: law on the full Z",
}
ALONE = ("pd", "printed-pd")
LIMBS = {"trunk": slice(0, 3), "left arm": slice(3, 11), "right arm": slice(11, 19)}


def _pose(trunk: Sequence[float], left: Sequence[float], right: Sequence[float]) -> Floats:
    # to the eye the arms mirror each other; about these axes that turns the sign
    mirrored = np.array([-1, 1, -1, -1, 1, -1, 1, -1]) * np.array(right)
    pose: Floats = np.deg2rad(np.concatenate([trunk, left, mirrored]))
    return pose


HOME = np.zeros(19)
# deg: trunk yaw, pitch, roll; clavicle, shoulder pitch, roll, yaw, elbow, wrist yaw, pitch, roll; assumed
ESTIMATION = _pose([25, 20, 10], [12, -55, 30, 25, 60, 20, 25, -20], [8, -40, 45, -20, 75, -25, -20, 20])
ONE = _pose([-20, 10, -8], [5, -80, 15, -20, 40, -30, 10, 25], [10, -60, 20, 30, 50, 20, 15, -15])
TWO = _pose([30, 25, 5], [10, -30, 60, 30, 90, 10, -25, 10], [5, -90, 25, -25, 30, -20, 20, 20])


class Move(NamedTuple):
    """A motion from rest to rest."""

    begin: float  # [s]
    end: float  # [s]
    goal: Floats  # (19,) [rad]


TIMELINE = (
    Move(0.2, 7.0, ESTIMATION),
    Move(12.0, 17.0, HOME),
    Move(17.0, 21.0, ONE),
    Move(22.0, 26.0, TWO),
    Move(27.0, 31.0, HOME),
)
WINDOWS = {  # [s] over which errors are summed up
    "estimation, last second": (11.0, 12.0),
    "homing": (12.0, 17.0),
    "approach one": (17.0, 21.0),
    "rest in pose one": (21.0, 22.0),
    "approach two": (22.0, 26.0),
    "rest in pose two": (26.0, 27.0),
    "homing again": (27.0, 31.0),
    "all after estimation": (12.0, 31.0),
}
AFTER_ESTIMATION, AFTER_PICK_UP = "all after estimation", "rest in pose two"
TENTH = 0.1  # of PD alone: what estimation is asked to bring the error to
PICK_UP = 21.0  # [s], 5 s before "rest in pose two"
PAYLOAD = Payload(2.0, "right_hand")

# one of trunk, eight of an arm; assumed: rotors behind their gearboxes, and stiffness
ROTORS = np.array([0.5] * 3 + 2 * [0.3, 0.3, 0.3, 0.1, 0.1, 0.02, 0.02, 0.02])  # [kg m2]
KP = np.array([4000, 6000, 6000] + 2 * [3000, 1500, 1500, 300, 600, 60, 60, 60.0])  # [Nm/rad]
DAMPING = 0.7
OMEGA = 4.0  # [1/s] of the paper's law
# 0.3 mrad of the spring: what a torque at 0.01 rad/s has beside gravity, in friction's place
NOISE = 3e-4 * KP
QUASI_STATIC = 0.01  # [rad/s] up to which the least squares count as rest
CARRIERS = ("left_hand", "right_hand")
ESTIMATED = (7.0, 12.0)  # [s] in the paper
NO_GATE = 1e3  # [rad/s] speed up to which the law runs as printed


@dataclass(frozen=True)
class Case:
    """One run."""

    controller: ControllerName
    start: Start = "zero"
    payload: bool = False

    @property
    def label(self) -> str:
        """The case in words."""
        words = [LABELS[self.controller]]
        if self.controller not in ALONE:
            words.append(f"from {'zero' if self.start == 'zero' else 'wrong parameters'}")
        return ", ".join([*words, "2 kg from 21 s"] if self.payload else words)

    @property
    def reference(self) -> "Case":
        """The case of PD alone with the same damping under the same load."""
        alone: ControllerName = "printed-pd" if self.controller.startswith("printed") else "pd"
        return Case(alone, payload=self.payload)


CASES = (
    Case("pd"),
    Case("law"),
    Case("law", "wrong"),
    Case("rls"),
    Case("rls", "wrong"),
    Case("printed-pd"),
    Case("printed-compact"),
    Case("printed-full"),
    Case("printed-compact", "wrong"),
    Case("printed-full", "wrong"),
    Case("pd", payload=True),
    Case("law", payload=True),
    Case("rls", payload=True),
)


def trajectory(timeline: Sequence[Move] = TIMELINE) -> SmoothedPath:
    """Return the motion from home through the goals; each leg begins and ends exactly at its times."""
    blend = 0.5 * min(move.end - move.begin for move in timeline)
    times, points = [], [HOME]
    for move in timeline:
        times += [move.begin, move.end - blend]
        points += [move.goal, move.goal]
    return SmoothedPath.through(times, points[:-1], blend)


def damping_gains(model: RobotModel) -> Floats:
    """Return the damping (19,) [Nms/rad] that goes with KP, for each joint's mean inertia over the poses."""
    poses = (HOME, ESTIMATION, ONE, TWO)
    inertia = np.mean([np.diag(mass_matrix(model, q)) for q in poses], axis=0) + ROTORS
    gains: Floats = 2.0 * DAMPING * np.sqrt(KP * inertia)
    return gains


def wrong_parameters(model: RobotModel, seed: int = 1, *, form: Form = "compact") -> Floats:
    """Return parameters of masses 0.5 to 2 times, and centres of mass 0.5 to 1.5 times, the true ones."""
    rng = np.random.default_rng(seed)
    links = len(model.tree.mass)
    mass = model.tree.mass * 2.0 ** rng.uniform(-1.0, 1.0, links)
    com = model.tree.com * rng.uniform(0.5, 1.5, (links, 1))
    wrong = replace(model, tree=model.tree._replace(mass=mass, com=com))
    return (
        compact_regressor(model).parameters(wrong) if form == "compact" else gravity_parameters(wrong).values
    )


class Scheduled:
    """An estimator that learns from one time to another, and otherwise gives the torque of what it knows."""

    def __init__(self, estimator: GravityEstimator, begin: float, end: float) -> None:
        """Take the estimator and the times [s]."""
        self._estimator, self._begin, self._end = estimator, begin, end

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Return the estimated gravity torque (19,) [Nm]."""
        if self._begin <= state.time < self._end:
            return self._estimator.follow(state, q_desired)
        return self._estimator.torque(state.q, state.gravity)


def controller_of(case: Case, model: RobotModel) -> Controller:
    """Return the controller of a case; estimators know the geometry and `start`."""
    kd = damping_gains(model)
    if case.controller in ALONE:
        return JointPD(KP, kd, damping="relative" if case.controller == "pd" else "absolute")
    form: Form = "full" if case.controller == "printed-full" else "compact"
    s0 = wrong_parameters(model, form=form) if case.start == "wrong" else None
    if case.controller.startswith("printed"):
        law = GravityEstimator(model, KP, kd, omega=OMEGA, s0=s0, max_speed=NO_GATE, form=form)
        return EstimatedGravityPD(KP, kd, Scheduled(law, *ESTIMATED), damping="absolute")
    if case.controller == "law":
        return EstimatedGravityPD(KP, kd, GravityEstimator(model, KP, kd, omega=OMEGA, s0=s0))
    learner = RecursiveGravityEstimator(model, noise=NOISE, s0=s0, max_speed=QUASI_STATIC, carriers=CARRIERS)
    return EstimatedGravityPD(KP, kd, learner)


def run(case: Case, timeline: Sequence[Move] = TIMELINE, *, duration: float | None = None) -> Floats:
    """Run a case; return the errors q_ref - q (ticks, 19) [rad], a row per millisecond."""
    model = load_robot("dual_arm_19")
    plant = MujocoPlant(model, start=HOME, hardware=JointHardware(armature=ROTORS))
    plant.home()
    errors: list[Floats] = []

    def observe(tick: Tick) -> None:
        errors.append(tick.reference.q - tick.state.q)
        if case.payload and tick.number == round(PICK_UP / plant.period):
            plant.attach(PAYLOAD)

    run_loop(plant, controller_of(case, model), trajectory(timeline), observers=[observe], duration=duration)
    return np.array(errors)


def rms_deg(errors: Floats, limb: str, window: tuple[float, float]) -> float:
    """Return the RMS error of a limb's joints over a window [deg]."""
    begin, end = (round(1000.0 * t) for t in window)
    return float(np.rad2deg(np.sqrt(np.mean(errors[begin:end, LIMBS[limb]] ** 2))))


@dataclass(frozen=True)
class Summary:
    """RMS errors of a case per window and limb, and what part of PD alone's they are."""

    case: Case
    rms: dict[str, dict[str, float]]  # [deg]
    ratio: dict[str, dict[str, float]]

    @property
    def reached(self) -> bool | None:
        """True if every limb's error fell to a tenth of PD alone's in the window that counts; None for PD itself."""
        if self.case.controller in ALONE:
            return None
        window = AFTER_PICK_UP if self.case.payload else AFTER_ESTIMATION
        return max(self.ratio[window].values()) <= TENTH


def summarise(errors: dict[Case, Floats]) -> list[Summary]:
    """Summarise all runs; PD alone under the same load must be among them."""
    rms = {
        case: {
            name: {limb: rms_deg(values, limb, window) for limb in LIMBS} for name, window in WINDOWS.items()
        }
        for case, values in errors.items()
    }
    return [
        Summary(
            case,
            rms[case],
            {
                name: {limb: value / rms[case.reference][name][limb] for limb, value in limbs.items()}
                for name, limbs in rms[case].items()
            },
        )
        for case in errors
    ]


def main(folder: Path) -> None:
    """Run all cases, print the tables, write dual_arm.json and dual_arm.html."""
    from papers.regressor.dual_arm_page import write_results

    errors: dict[Case, Floats] = {}
    for case in CASES:
        errors[case] = run(case)
        print(f"  done: {case.label}", file=sys.stderr, flush=True)
    write_results(folder, errors, summarise(errors))


if __name__ == "__main__":
    main(folder_argument(__doc__))
