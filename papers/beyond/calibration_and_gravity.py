"""Calibrated joints inside the gravity model, and gravity inside the calibration.

The learner of the positioning joints is trained level on zig-zags at 1/2, 1/3 and 1/4; then the robot, not homed
anew, follows 30 s of random motion in the calibrated box by PD+DG, level, at 20 deg about Z0 and rocking, and is held
by gravity compensation alone at five base angles. The gravity model, or the whole control, takes reported or calibrated
joints: calibrated by the model's zeros, and once by the rig's, which calls the same stops otherwise (the elbow's by 7.5
deg, the insertion's by 10.5 mm). In the whole control the calibration's input torque is what the control has just
asked for: the loop gives it slowly; once it is taken at once, and one calibration takes positions alone. Damping is
relative to the reference's velocity.

The other way round, models trained level or on several tilts take the robot's torque less the gravity model's in place
of the torque itself; conditions and raw torque are those of calibration on tilted and rocking bases.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from catenary import CablePlant, GravityPD, JointState, MotionLog, Reference, random_sinusoids
from catenary.arrays import Flags, Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.control.correction import StateCorrector
from catenary.control.loop import Tick, run_loop
from catenary.control.pd import GravityHold, JointPD
from catenary.errors import InputError
from catenary.plant import Plant
from catenary.workflows.gravity_trials import HOLD_START, SimulatedArm, hold_arm, raven_arm, with_approach
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.beyond import tilted_calibration as tilted
from papers.beyond.tilted_calibration import BASES, LEVEL_BASE, ROCKING, homed_level, put_on
from papers.calibration.recordings import SPARSITIES, calibration_log, draws, fitted
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.gravity.raven_base import SHOWN, turned_base
from papers.gravity.static_poses import rms
from papers.kit import JOINTS, UNITS, Missing, by_robot, cells, rows, sample, table, unless_missing

N = 3
SETTLE = 1.0  # [s] at a motion's start
REPORTED, INSIDE, BOTH, RIG = ("reported", "calibrated in gravity", "calibrated in all", "calibrated, rig's zeros")
AT_ONCE, STILL = "calibrated in all, torque at once", "calibrated in all, by positions"
CONTROLLERS = (REPORTED, INSIDE, BOTH, AT_ONCE, STILL, RIG)
IN_ALL = (BOTH, AT_ONCE, STILL)
HOLDS = (REPORTED, INSIDE, RIG)
CONTROL_BASES = (LEVEL_BASE, tilted.TILTED, ROCKING)
ANGLES_DEG = (0.0, 20.0, 45.0, 90.0, 180.0)
SECONDS, HOLD_SECONDS = 30.0, 5.0
TRAININGS = (tilted.LEVEL, tilted.SEVERAL)
TORQUES = {tilted.PAPERS: "raw torque", tilted.LESS_GRAVITY: "torque less gravity"}
NEWTONS = ("Nm", "Nm", "N")
COLORS = dict(zip(CONTROLLERS, ("#8a94a3", "#2f8f6b", "#4b6b94", "#c9a227", "#d9622b", "#b8bfc9"), strict=True))
DRAWN = (REPORTED, INSIDE, STILL, BOTH)


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


class AtOnce:
    """A corrector that takes torques as they are measured, which `run_loop` gives slowly."""

    def __init__(self, corrector: Corrector, plant: Plant) -> None:
        """Take a corrector and the arm that it is asked about."""
        self.prepare, self._corrector, self._plant = corrector.prepare, corrector, plant

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write calibrated positions (n,) [rad|m], whether each is inside the valid range, and half-widths [rad|m]."""
        self._corrector.correct_state(state._replace(tau=self._plant.measured_js().tau), out, inside, interval)


def prepared(arm: SimulatedArm, model: CalibrationModel) -> Corrector:
    """Return a model's corrector for an arm at 1 kHz."""
    corrector = Corrector(model)
    corrector.prepare(arm.plant.joint_names, arm.plant.joint_units, 1.0 / arm.plant.period)
    return corrector


def calibrations(plant: CablePlant, log: MotionLog) -> dict[str, CalibrationModel]:
    """Fit models of the positioning joints, by the names of the controllers that take them.

    All but one give the gravity model's zeros; one takes positions alone.
    """
    turned = plant.firmware.stop_value[:N] - plant.encoders.rig.registered
    if log.q_encoder is None:
        raise InputError(f'recording "{log.name}": has no encoders')
    own = replace(log, q_encoder=log.q_encoder + turned)
    options = FitOptions(inputs=POSITIONING_INPUTS)
    model = fitted([own], options)
    return {
        RIG: fitted([log], options),
        INSIDE: model,
        BOTH: model,
        AT_ONCE: model,
        STILL: fitted([own], FitOptions(inputs=POSITIONING_INPUTS[:N])),
    }


@run(revision=4)
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
    if name == AT_ONCE:
        corrector = AtOnce(prepared(arm, models[name]), arm.plant)
    if name in (INSIDE, RIG):
        controller = CalibratedGravity(arm, models[name], gains=True)
    motion, begin = with_approach(arm, random_sinusoids(draws(seed, 60), seconds), SETTLE)
    rows: list[tuple[Floats, ...]] = []
    true_gravity = GravityHold(arm.model)

    def observe(tick: Tick) -> None:
        if tick.time >= begin and tick.tau is not None:
            q = arm.q_true()
            row = (tick.reference.q - tick.q_nominal, tick.reference.q - q, controller.feedback.copy())
            wrong = controller.feedforward - true_gravity.torque(tick.state._replace(q=q), tick.reference)
            rows.append((*row, tick.tau, wrong))

    done = run_loop(
        arm.plant, controller, motion, limits=arm.limits(), rate_hz=1.0 / plant.period,
        corrector=corrector, observers=[observe],
    )  # fmt: skip
    reported, true, feedback, torque, wrong = (np.array(column) for column in zip(*rows, strict=True))
    outside = done.outside_valid_range or (0.0,) * N
    return {
        "reported": (SHOWN * rms(reported)).tolist(),
        "true": (SHOWN * rms(true)).tolist(),
        "pd_share": (100.0 * rms(feedback) / rms(torque)).tolist(),
        "gravity": rms(wrong).tolist(),
        "outside": list(outside),
    }


@run(revision=2)
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
    drift: list[float] = (SHOWN * hold_arm(arm, alone, HOLD_START, seconds).drift).tolist()
    return drift


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
            tilted.cases_of(seed, training, torque, scope)[0]
            for training in (TRAININGS[:1] if scope.quick else TRAININGS)
            for torque in TORQUES
        ]
    return made


def measured(o: Outcomes, base: str, controller: str, what: str) -> Floats:
    """Return a measure of tracking on every joint, (robots, 3)."""
    return sample(o, control, controller, what, base=base)


def drift(o: Outcomes, controller: str, angle: float) -> Floats:
    """Return how far held joints went on a base at an angle [deg], (robots, 3) [deg, deg, mm]."""
    drifts = [(arguments["angles_deg"], result[controller]) for arguments, result in o.items(held)]
    there = [each[angles.index(angle)] for angles, each in drifts if angle in angles]
    if not there:
        raise Missing(f"{angle} deg")
    return by_robot(there)


def report(o: Outcomes) -> Report:
    """Return tables of tracking, holding and calibration, the picture, and what they come to."""
    title = "PD+DG along random motion in the calibrated box, RMS"
    header = (
        "base | joints | PD share J1; J2; J3 [%] | reported error [deg; deg; mm] | true error [deg; deg; mm] | gravity "
        "wrong by [Nm; Nm; N] | outside valid range [%]"
    )
    holding = "Gravity compensation alone: largest drift, mean of robots (greatest)"
    units = f"[{'; '.join(f'{joint} {unit}' for joint, unit in zip(JOINTS, UNITS, strict=True))}]"
    tables = [
        table(title, header, rows(partial(_tracking, o), CONTROL_BASES, CONTROLLERS)),
        table(holding, ["base about Z0 [deg]", *HOLDS], rows(partial(_holding, o), ANGLES_DEG)),
        table(
            "RMSE of models by the torque among their inputs",
            ["trained", "torque", "model", *(f"{base} {units}" for base in BASES)],
            rows(partial(_calibration, o), TRAININGS, TORQUES, tilted.KINDS),
        ),
    ]
    caption = (
        "Left: what the gravity model is wrong by against the true joints. Middle: true tracking error. Both on every "
        "base, mean over robots. Right: RMSE of joint 1 on every base by the torque among the inputs"
    )
    return Report(tables, {caption: _picture(o)}, _remarks(o))


def _tracking(o: Outcomes, base: str, name: str) -> list[str]:
    digits = {"pd_share": 1, "reported": 3, "true": 3, "gravity": 3}
    columns = ("; ".join(cells(measured(o, base, name, what), count)) for what, count in digits.items())
    return [base, name, *columns, f"{100.0 * measured(o, base, name, 'outside').max(axis=1).mean():.0f}"]


def _holding(o: Outcomes, angle: float) -> list[str]:
    columns = (zip(drift(o, name, angle).T, UNITS, strict=True) for name in HOLDS)
    return [f"{angle:.0f}", *("; ".join(f"{v.mean():.3f} ({v.max():.3f}) {u}" for v, u in each) for each in columns)]


def _calibration(o: Outcomes, training: str, torque: str, model: str) -> list[str]:
    columns = ("; ".join(cells(tilted.errors(o, training, torque, base, model))) for base in BASES)
    return [training, TORQUES[torque], model, *columns]


def _remarks(o: Outcomes) -> list[str]:
    return [*_in_gravity(o), *_in_calibration(o)]


@unless_missing
def _in_gravity(o: Outcomes) -> str:
    def joints(controller: str, what: str, digits: int = 3) -> str:
        errors = np.concatenate([measured(o, base, controller, what) for base in CONTROL_BASES])
        return "/".join(f"{value:.{digits}f}" for value in errors.mean(axis=0))

    return (
        f"With calibrated joints the gravity model is wrong by {joints(INSIDE, 'gravity')} Nm/Nm/N in place of "
        f"{joints(REPORTED, 'gravity')}, and PD's share goes from {joints(REPORTED, 'pd_share', 1)} to "
        f"{joints(INSIDE, 'pd_share', 1)} %; where PD, too, takes calibrated joints, the true error goes from "
        f"{joints(REPORTED, 'true')} to {joints(BOTH, 'true')} deg/deg/mm, to {joints(STILL, 'true')} where they are "
        f"calibrated by positions alone, and to {joints(AT_ONCE, 'true')} where torques are taken at once."
    )


@unless_missing
def _in_calibration(o: Outcomes) -> str:
    others = [base for base in BASES if base != LEVEL_BASE]
    raw, less = (
        tilted.joints(*(tilted.errors(o, tilted.LEVEL, torque, base, "linear") for base in others))
        for torque in TORQUES
    )
    return (
        f"A linear model calibrated level errs on tilted and rocking bases by {raw} deg/deg/mm with the robot's torque "
        f"among its inputs, and by {less} with that torque less the gravity model's."
    )


def _picture(o: Outcomes) -> Any:
    figure, (wrong, error, calibrated) = panels(3, 3.6)
    for panel, what, units in ((wrong, "gravity", NEWTONS), (error, "true", UNITS)):
        for k, name in enumerate(DRAWN):
            there = [base for base in CONTROL_BASES if o.of(control, base=base)]
            if there:
                values = np.concatenate([measured(o, base, name, what) for base in there])
                places = np.arange(3) + 0.2 * (k - 1.5)
                panel.bar(places, values.mean(axis=0), 0.18, color=COLORS[name], label=name)
        panel.set_xticks(range(3), [f"{j} [{u}]" for j, u in zip(JOINTS, units, strict=True)])
    wrong.set_title("gravity model wrong by, RMS", fontsize=10)
    error.set_title("true tracking error, RMS", fontsize=10)
    for k, (torque, color) in enumerate(zip(TORQUES, ("#8a94a3", "#d9622b"), strict=True)):
        for i, training in enumerate(TRAININGS):
            places = np.arange(len(BASES)) + 0.2 * (2 * i + k - 1.5)
            style = {"color": color, "alpha": 1.0 if i == 0 else 0.55, "label": f"{TORQUES[torque]}, {training}"}
            with suppress(Missing):
                means = [tilted.errors(o, training, torque, base, "linear")[:, 0].mean() for base in BASES]
                calibrated.bar(places, means, 0.18, **style)
    calibrated.set_xticks(range(len(BASES)), BASES, rotation=35, fontsize=8, ha="right")
    calibrated.set_title("linear model, RMSE of J1 [deg]", fontsize=10)
    legend_below(figure, error, calibrated, columns=4)
    return figure


EXPERIMENT = Experiment(
    "beyond-calibration-and-gravity", "beyond both",
    "Calibrated joints inside the gravity model, and gravity inside the calibration", __doc__,
    cases, report, minutes=18.0,
)  # fmt: skip
