"""A robot under PD+DG whose gravity model, or whose whole control, sees calibrated joints: cases.

The gravity model knows joints by the robot's own zeros. A rig of encoders calls the same stops otherwise (RAVEN-II's
elbow by 7.5 deg, its insertion by 10.5 mm), so that what a calibration gives has to be turned back to the model's zeros
before gravity is computed there; what happens where nobody does is a case of its own.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from catenary import CablePlant, GravityPD, JointState, MotionLog, Reference, random_sinusoids
from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.control.gravity_pd import GravityHold
from catenary.control.loop import StateCorrector, Tick, run_loop
from catenary.control.pd import JointPD
from catenary.errors import InputError
from catenary.workflows.gravity.motions import HOLD_START
from catenary.workflows.gravity.simulated_arm import SimulatedArm, raven_arm
from catenary.workflows.gravity.trials import hold, with_approach
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.beyond.bases import BASES, homed_level, put_on
from papers.calibration.recordings import calibration_log, draws, fitted, unguarded
from papers.experiment import Result, run
from papers.gravity.raven_base import SHOWN, turned_base

N = 3
SETTLE = 1.0  # [s] at a motion's start
REPORTED, INSIDE, BOTH, RIG = ("reported", "calibrated in gravity", "calibrated in all", "calibrated, rig's zeros")
FREE, STILL = "calibrated in all, everywhere", "calibrated in all, by positions"
CONTROLLERS = (REPORTED, INSIDE, BOTH, FREE, STILL, RIG)
IN_ALL = (BOTH, FREE, STILL)
HOLDS = (REPORTED, INSIDE, RIG)


class CalibratedGravity:
    """PD on reported joints with the sensed gravity at calibrated ones; without gains, that gravity alone."""

    def __init__(self, arm: SimulatedArm, model: CalibrationModel, *, gains: bool) -> None:
        """Take an arm and its calibration."""
        self._corrector = prepared(arm, model)
        self._pd = JointPD(*arm.gains) if gains else None
        self._hold = GravityHold(arm.model)
        self._q, self._inside = np.zeros(arm.model.n), np.zeros(arm.model.n, dtype=bool)
        self.feedback, self.feedforward = np.zeros(arm.model.n), np.zeros(arm.model.n)

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return the torques (n,) [Nm|N]."""
        self._corrector.correct_state(state, self._q, self._inside)
        self.feedforward[:] = self._hold.torque(state._replace(q=self._q.copy()), reference)
        self.feedback[:] = 0.0 if self._pd is None else self._pd.torque(state, reference)
        total: Floats = self.feedback + self.feedforward
        return total


def prepared(arm: SimulatedArm, model: CalibrationModel) -> Corrector:
    """Return a model's corrector for an arm at 1 kHz."""
    corrector = Corrector(model)
    corrector.prepare(arm.plant.joint_names, arm.plant.joint_units, 1.0 / arm.plant.period)
    return corrector


def calibrations(plant: CablePlant, log: MotionLog) -> dict[str, CalibrationModel]:
    """Fit linear models of the positioning joints, by the names of the controllers that take them.

    All but one give the gravity model's zeros. Where control itself takes calibrated joints, its torque comes back as
    an input of the calibration: so one model is asked beyond its valid range too, and one takes positions alone.
    """
    turned = plant.firmware.stop_value[:N] - plant.encoders.rig.registered
    if log.q_encoder is None:
        raise InputError(f'recording "{log.name}": has no encoders')
    own = replace(log, q_encoder=log.q_encoder + turned)
    options = FitOptions(kind="linear", inputs=POSITIONING_INPUTS)
    model = fitted([own], options)
    return {
        RIG: fitted([log], options),
        INSIDE: model,
        BOTH: model,
        FREE: unguarded(model),
        STILL: fitted([own], FitOptions(kind="linear", inputs=POSITIONING_INPUTS[:N])),
    }


@run(revision=2)
def control(seed: int | None, base: str, sparsities: Sequence[float], seconds: float) -> Result:
    """Calibrate a robot level, put it on a base, and follow random motion in the calibrated box with every controller.

    Returns:
        By controller, on J1, J2, J3: `reported` and `true` tracking error [deg, deg, mm], `pd_share` [%], by how much
        the gravity term differs from that at the true joints, `gravity` [Nm, Nm, N], all RMS; share of ticks `outside`
        the valid range.
    """
    robot = homed_level(seed, substeps=2)
    plant = robot[0]
    models = calibrations(plant, calibration_log(plant, draws(seed, 0), sparsities=sparsities))
    return {name: _followed(put_on(robot, BASES[base]), models, name, seed, seconds) for name in CONTROLLERS}


def _followed(
    plant: CablePlant, models: Mapping[str, CalibrationModel], name: str, seed: int | None, seconds: float
) -> dict[str, list[float]]:
    arm = raven_arm(plant)
    controller: GravityPD | CalibratedGravity = GravityPD(arm.model, *arm.gains)
    corrector: StateCorrector | None = prepared(arm, models[name]) if name in IN_ALL else None
    if name in (INSIDE, RIG):
        controller = CalibratedGravity(arm, models[name], gains=True)
    motion, begin = with_approach(arm, random_sinusoids(draws(seed, 60), seconds), SETTLE)
    rows: list[tuple[Floats, ...]] = []
    true_gravity = GravityHold(arm.model)

    def observe(tick: Tick) -> None:
        if tick.time >= begin and tick.tau is not None:
            q = arm.q_true()
            told = (tick.reference.q - tick.q_nominal, tick.reference.q - q, controller.feedback.copy())
            wrong = controller.feedforward - true_gravity.torque(tick.state._replace(q=q), tick.reference)
            rows.append((*told, tick.tau, wrong))

    done = run_loop(
        arm.plant, controller, motion, limits=arm.limits(), rate_hz=1.0 / plant.period,
        corrector=corrector, observers=[observe],
    )  # fmt: skip
    reported, true, feedback, torque, wrong = (np.array(column) for column in zip(*rows, strict=True))
    outside = done.outside_valid_range or (0.0,) * N
    return {
        "reported": (SHOWN * _rms(reported)).tolist(),
        "true": (SHOWN * _rms(true)).tolist(),
        "pd_share": (100.0 * _rms(feedback) / _rms(torque)).tolist(),
        "gravity": _rms(wrong).tolist(),
        "outside": list(outside),
    }


def _rms(values: Floats) -> Floats:
    rms: Floats = np.sqrt(np.mean(values**2, axis=0))
    return rms


@run(revision=1)
def held(seed: int | None, angles_deg: Sequence[float], sparsities: Sequence[float], seconds: float) -> Result:
    """Hold a robot by gravity compensation alone on bases turned about Z0, at reported or at calibrated joints.

    Returns:
        By controller: for every angle the largest true drift on J1, J2, J3 [deg, deg, mm].
    """
    robot = homed_level(seed, substeps=2)
    plant = robot[0]
    models = calibrations(plant, calibration_log(plant, draws(seed, 0), sparsities=sparsities))
    return {
        name: [_drift(raven_arm(put_on(robot, turned_base(angle))), models, name, seconds) for angle in angles_deg]
        for name in HOLDS
    }


def _drift(arm: SimulatedArm, models: Mapping[str, CalibrationModel], name: str, seconds: float) -> list[float]:
    alone: GravityHold | CalibratedGravity = GravityHold(arm.model)
    if name != REPORTED:
        alone = CalibratedGravity(arm, models[name], gains=False)
    drift: list[float] = (SHOWN * hold(arm, alone, HOLD_START, seconds).drift).tolist()
    return drift
