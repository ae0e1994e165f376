"""The 19-joint upper body of the gravity-regressor paper's section III, simulated in MuJoCo: one run of it.

The paper's timeline at 1 kHz: approach 0.2-7 s, estimation 7-12 s, homing 12-17 s, approach one 17-21 s, approach two
22-26 s, homing 27-31 s.

Choices where the paper is silent: the poses (below); gains that let PD alone sag by some tenths of a degree ("quite
huge", the paper says of its own), with rotors in the drives, without which a wrist of 1 g m2 bears no such gains at
1 kHz. The paper's protocol, "as printed": estimation from 7 to 12 s, damping -Kd qd. It does not say whether Z was the
full or the compact one, and of s_0 that it "is assumed to be zero": both forms and both starts are run. Ours
estimates all the time, holding still by itself while the arm moves, and damps the velocity's error.

The paper has one robot. Robots drawn by a seed have true masses within 30 % and centres of mass within 20 % of the
nominal one's, each link by itself; geometry, gains and rotors stay.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from catenary import EstimatedGravityPD, MujocoPlant, RobotModel, compact_regressor, load_robot, mass_matrix
from catenary.arrays import Floats
from catenary.control.loop import Tick, run_loop
from catenary.control.pd import Controller, JointPD
from catenary.gravity.estimator import Form, GravityEstimator, RecursiveGravityEstimator
from catenary.gravity.gravity_regressor import gravity_parameters
from catenary.gravity.payload import Payload
from catenary.plant import JointState
from catenary.simulation.joint_hardware import JointHardware
from catenary.trajectories.smoothed_path import SmoothedPath
from papers.experiment import Result, run
from papers.regressor.published import APPROACH_ONE, APPROACH_POSE, APPROACH_TWO, ESTIMATION, HOMING, HOMING_AGAIN

# printed: as the paper prints it, damping -Kd qd, and estimation from 7 to 12 s on the compact or the full Z; longer:
# the same to the end of the motion; moving: the same for the five seconds of homing that follow
ControllerName = Literal[
    "pd", "law", "rls", "printed-pd", "printed-compact", "printed-full", "printed-longer", "printed-moving"
]
LEARNS = {"printed-longer": (ESTIMATION[0], HOMING_AGAIN[1]), "printed-moving": HOMING}  # [s]; others: ESTIMATION
Start = Literal["zero", "wrong"]
ALONE = ("pd", "printed-pd")
LIMBS = {"trunk": slice(0, 3), "left arm": slice(3, 11), "right arm": slice(11, 19)}


def _pose(trunk: Sequence[float], left: Sequence[float], right: Sequence[float]) -> Floats:
    # to the eye the arms mirror each other; about these axes that turns the sign
    mirrored = np.array([-1, 1, -1, -1, 1, -1, 1, -1]) * np.array(right)
    pose: Floats = np.deg2rad(np.concatenate([trunk, left, mirrored]))
    return pose


HOME = np.zeros(19)
# deg: trunk yaw, pitch, roll; clavicle, shoulder pitch, roll, yaw, elbow, wrist yaw, pitch, roll; assumed
LEARNING = _pose([25, 20, 10], [12, -55, 30, 25, 60, 20, 25, -20], [8, -40, 45, -20, 75, -25, -20, 20])
ONE = _pose([-20, 10, -8], [5, -80, 15, -20, 40, -30, 10, 25], [10, -60, 20, 30, 50, 20, 15, -15])
TWO = _pose([30, 25, 5], [10, -30, 60, 30, 90, 10, -25, 10], [5, -90, 25, -25, 30, -20, 20, 20])


class Move(NamedTuple):
    """A motion from rest to rest."""

    begin: float  # [s]
    end: float  # [s]
    goal: Floats  # (19,) [rad]


TIMELINE = (
    Move(*APPROACH_POSE, LEARNING),
    Move(*HOMING, HOME),
    Move(*APPROACH_ONE, ONE),
    Move(*APPROACH_TWO, TWO),
    Move(*HOMING_AGAIN, HOME),
)
WINDOWS = {  # [s] over which errors are summed up
    "before estimation": (6.9, 7.0),
    "estimation, last second": (11.0, 12.0),
    "homing": HOMING,
    "approach one": APPROACH_ONE,
    "rest in pose one": (21.0, 22.0),
    "approach two": APPROACH_TWO,
    "rest in pose two": (26.0, 27.0),
    "homing again": HOMING_AGAIN,
    "all after estimation": (12.0, 31.0),
}
PICK_UP = 21.0  # [s], 5 s before "rest in pose two"
CARRIER = "right_hand"
SAMPLE = 0.1  # [s] between the errors that pictures show
MASS_SHARE, COM_SHARE = 0.3, 0.2  # by how much drawn robots differ

# one of trunk, eight of an arm; assumed: rotors behind their gearboxes, and stiffness
ROTORS = np.array([0.5] * 3 + 2 * [0.3, 0.3, 0.3, 0.1, 0.1, 0.02, 0.02, 0.02])  # [kg m2]
KP = np.array([4000, 6000, 6000] + 2 * [3000, 1500, 1500, 300, 600, 60, 60, 60.0])  # [Nm/rad]
DAMPING = 0.7
OMEGA = 4.0  # [1/s] of the paper's law
# 0.3 mrad of the spring: what a torque at 0.01 rad/s has beside gravity, in friction's place
NOISE = 3e-4 * KP
QUASI_STATIC = 0.01  # [rad/s] up to which the least squares count as rest
CARRIERS = ("left_hand", "right_hand")
NO_GATE = 1e3  # [rad/s] speed up to which the law runs as printed


def robot(seed: int | None) -> RobotModel:
    """Return the upper body: the nominal one, or one whose true masses and centres of mass a seed draws."""
    model = load_robot("dual_arm_19")
    if seed is None:
        return model
    rng, tree = np.random.default_rng(seed), model.tree
    links = len(tree.mass)
    heavier = rng.uniform(1.0 - MASS_SHARE, 1.0 + MASS_SHARE, links)
    further = rng.uniform(1.0 - COM_SHARE, 1.0 + COM_SHARE, (links, 1))
    drawn = tree._replace(
        mass=tree.mass * heavier, com=tree.com * further, inertia=tree.inertia * heavier[:, None, None]
    )
    return replace(model, tree=drawn)


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
    poses = (HOME, LEARNING, ONE, TWO)
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
    return compact_regressor(model).parameters(wrong) if form == "compact" else gravity_parameters(wrong).values


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


def controller_of(controller: ControllerName, start: Start, model: RobotModel, *, pace: float = 1.0) -> Controller:
    """Return a controller; gains are for the nominal robot, and estimators know the geometry and `start`."""
    kd = damping_gains(robot(None))
    if controller in ALONE:
        return JointPD(KP, kd, damping="relative" if controller == "pd" else "absolute")
    form: Form = "full" if controller == "printed-full" else "compact"
    s0 = wrong_parameters(model, form=form) if start == "wrong" else None
    if controller.startswith("printed"):
        law = GravityEstimator(model, KP, kd, omega=OMEGA * pace, s0=s0, max_speed=NO_GATE, form=form)
        begin, end = LEARNS.get(controller, ESTIMATION)
        return EstimatedGravityPD(KP, kd, Scheduled(law, begin / pace, end / pace), damping="absolute")
    if controller == "law":
        return EstimatedGravityPD(KP, kd, GravityEstimator(model, KP, kd, omega=OMEGA, s0=s0))
    learner = RecursiveGravityEstimator(model, noise=NOISE, s0=s0, max_speed=QUASI_STATIC, carriers=CARRIERS)
    return EstimatedGravityPD(KP, kd, learner)


def errors_of(
    seed: int | None,
    controller: ControllerName,
    start: Start,
    payload_kg: float,
    *,
    timeline: Sequence[Move] = TIMELINE,
    pace: float = 1.0,
    duration: float | None = None,
) -> Floats:
    """Run the motion, `pace` times as fast as the paper's, for a duration [s]; return q_ref - q (ticks, 19) [rad].

    The right hand takes the payload up at PICK_UP, unknown to the controller.
    """
    model = robot(seed)
    plant = MujocoPlant(model, start=HOME, hardware=JointHardware(armature=ROTORS))
    plant.home()
    errors: list[Floats] = []

    def observe(tick: Tick) -> None:
        errors.append(tick.reference.q - tick.state.q)
        if payload_kg > 0.0 and tick.number == round(PICK_UP / pace / plant.period):
            plant.attach(Payload(payload_kg, CARRIER))

    paced = [Move(move.begin / pace, move.end / pace, move.goal) for move in timeline]
    law = controller_of(controller, start, model, pace=pace)
    run_loop(plant, law, trajectory(paced), observers=[observe], duration=duration)
    return np.array(errors)


def rms_deg(errors: Floats, limb: str, window: tuple[float, float]) -> float:
    """Return the RMS error of a limb's joints over a window [deg]."""
    begin, end = (round(1000.0 * t) for t in window)
    return float(np.rad2deg(np.sqrt(np.mean(errors[begin:end, LIMBS[limb]] ** 2))))


@run(revision=3)
def dual_arm(seed: int | None, controller: str, start: str, payload_kg: float, pace: float) -> Result:
    """Run the motion; return RMS errors by window and limb [deg], and each joint's error over time [deg]."""
    if controller not in get_args(ControllerName) or start not in get_args(Start):
        raise ValueError(f'no controller "{controller}" from "{start}"')
    errors = errors_of(seed, controller, start, payload_kg, pace=pace)  # type: ignore[arg-type]
    every = round(1000.0 * SAMPLE / pace)
    return {
        "rms_deg": {
            name: {limb: rms_deg(errors, limb, (begin / pace, end / pace)) for limb in LIMBS}
            for name, (begin, end) in WINDOWS.items()
        },
        "errors_deg": np.round(np.rad2deg(errors[::every]), 4).T.tolist(),
    }
