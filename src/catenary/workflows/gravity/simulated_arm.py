"""A simulated arm with all that a controller of it needs: plant, model, gains, limits, the sensor on its base."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.control.gains import (
    JointGains,
    default_limits,
    gains_at_joints,
    gains_from_mass,
    reflected_inertia,
    torque_at_joints,
)
from catenary.control.limits import TorqueLimits
from catenary.errors import InputError
from catenary.open_robot import Simulated, open_robot, refuse_unsupported
from catenary.plant import Plant
from catenary.robots.actuation import joint_drives
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.robots.model import Massless, RobotModel
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Mailbox
from catenary.simulation.base_motion import MovingBase
from catenary.simulation.cable_parameters import CableArm, Firmware
from catenary.simulation.cable_plant import CablePlant, PositioningArm
from catenary.simulation.joint_hardware import JointHardware
from catenary.simulation.records import POSITIONING
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SimulatedArm:
    """A homed arm; the model's joints are the plant's, in the same order."""

    plant: Plant
    model: RobotModel
    gains: JointGains
    largest_torque: Floats  # (n,) [Nm|N], infinity for none
    q_true: Callable[[], Floats]  # where the joints really are, (n,) [rad|m]
    motor_inertia: Floats | None = None  # (n, n) what motors add to the mass matrix
    stiffness: Floats | None = None  # (n,) of elastic joints [Nm/rad|N/m]

    def limits(self) -> TorqueLimits:
        """Return the arm's torque limits, in their initial state."""
        return default_limits(self.largest_torque, self.plant.joint_units, self.plant.lower, self.plant.upper)


def simulated_arm(
    robot: str,
    *,
    base: MovingBase | None = None,
    payload: float = 0.0,
    seed: int | None = None,
    massless: Massless = (),
    strict: bool = False,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    viscous: ArrayLike | None = None,
) -> SimulatedArm:
    """Put an arm on a base, a level one when None, switch it on and home it.

    RAVEN-II's positioning joints, behind their cables, with the gains of the robot's own control: what it believes of
    itself, also where the simulated robot is another (`seed`). Of any other robot the rigid bodies of its model, and
    gains by rule; with the friction and rotors of its joints where it was identified, and ideal drives otherwise.

    Args:
        robot: raven2 or raven2_right, or any other robot with inertia: a name or a file.
        payload: Mass at the tool's wrist, or at the tip [kg], of which the model knows nothing.
        kp: Stiffness of PD, one number or (n,) [Nm/rad|N/m]; kd: its damping [Nms/rad|Ns/m]; the arm's own when None.
        friction: Coulomb friction of a robot without cables, one number or (n,) [Nm|N]; viscous: likewise
            [Nms/rad|Ns/m]; what was identified, if anything, when None.
    """
    drives = None if friction is None and viscous is None else JointHardware()  # which only some robots have
    where = Simulated(seed, base, payload, hardware=drives)
    refuse_unsupported(robot, where)
    if robot not in RAVEN_SIDES:
        model = load_robot(robot, massless=massless, strict=strict)
        own = None if model.actuation is None else joint_drives(model.actuation, model.n)
        if own is not None and own.left_out:
            _log.warning(
                'robot "%s": simulated with its Coulomb and viscous friction and rotors, joint by joint; without %s',
                model.name,
                ", ".join(own.left_out),
            )
        given = {"friction": friction, "damping": viscous}
        hardware = replace(
            JointHardware() if own is None else JointHardware(own.friction, own.damping),
            **{key: value for key, value in given.items() if value is not None},
        )
        rotors = None if own is None else own.armature
        arm = rigid_arm(model, base=base, payload=payload, hardware=hardware, motor_inertia=rotors)
        return with_gains(arm, kp, kd)
    return with_gains(raven_arm(cast(CablePlant, open_robot(robot, where))), kp, kd)


def with_gains(arm: SimulatedArm, kp: ArrayLike | None, kd: ArrayLike | None) -> SimulatedArm:
    """Return an arm with other gains at its joints: one number for all, or (n,); its own where None."""
    chosen = []
    for name, own, given in zip(("kp", "kd"), arm.gains, (kp, kd), strict=True):
        values = own if given is None else as_array(name, given, () if np.ndim(given) == 0 else own.shape)
        if not (values >= 0.0).all():
            raise InputError(f"{name}: expected zero or more, got {values.tolist()}")
        chosen.append(np.broadcast_to(values, own.shape).copy())
    return replace(arm, gains=JointGains(*chosen))


def rigid_arm(
    model: RobotModel,
    *,
    base: MovingBase | None = None,
    payload: float = 0.0,
    start: ArrayLike | None = None,
    motor_inertia: ArrayLike | None = None,
    hardware: JointHardware | None = None,
) -> SimulatedArm:
    """Simulate any robot as rigid bodies, enabled, with gains by rule.

    It stands at `start` (n,) [rad|m] on a base, as `open_robot` has them when None, with a payload [kg] at its tip
    of which the model knows nothing. `hardware` is its friction, `motor_inertia` (n,) rotors at its joints [kg m2|kg].
    """
    model.require_inertia()
    n = model.n
    rotors = as_array("motor_inertia", np.zeros(n) if motor_inertia is None else motor_inertia, (n,))
    added = np.diag(rotors) if rotors.any() else None
    drives = replace(hardware or JointHardware(), armature=rotors)
    plant = open_robot(model, Simulated(base=base, payload=payload, start=start, hardware=drives))
    return SimulatedArm(
        plant=plant,
        model=model,
        gains=gains_from_mass(model, motor_inertia=added),
        largest_torque=np.array(model.effort_limit),
        q_true=lambda: plant.telemetry()["q_true"],
        motor_inertia=added,
    )


def raven_arm(plant: CablePlant) -> SimulatedArm:
    """Return a homed RAVEN-II as an arm of three joints, with its firmware's gains and its nominal springs."""
    part, firmware, n = PositioningArm(plant), plant.arm.firmware, POSITIONING
    return SimulatedArm(
        plant=part,
        model=load_robot("raven2" if plant.side == "left" else "raven2_right"),
        gains=raven_gains(firmware),
        # at level "moderate": 7.5, 6.7 Nm, 95 N, from its DAC limits
        largest_torque=torque_at_joints(
            firmware.dac_limit[:n], firmware.dac_per_ampere[:n], firmware.torque_constant[:n], firmware.ratio[:n]
        ),
        q_true=lambda: part.q_true,
        motor_inertia=raven_motor_inertia(plant.arm),
        stiffness=np.array(plant.arm.file.cable["stiffness"].value),
    )


def raven_gains(firmware: Firmware) -> JointGains:
    """Return gains of RAVEN-II's own control at its positioning joints: 454, 362 Nm/rad, 57.1 kN/m; 12.1, 9.6, 4564.

    [RAVEN-II source: Kp, Kd per motor, at the gearbox's output]
    """
    return gains_at_joints(*(getattr(firmware, name)[:POSITIONING] for name in ("kp", "kd", "ratio", "gearbox")))


def raven_motor_inertia(arm: CableArm) -> Floats:
    """Return what RAVEN-II's motors add to the mass matrix, by its nominal ratios and coupling, (3, 3)."""
    ratio = np.abs(arm.firmware.ratio[:POSITIONING])
    return reflected_inertia(arm.cable.rotor_inertia, ratio, arm.firmware.coupling)


def base_sensor(
    base: MovingBase,
    *,
    start: float = 0.0,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    noise: float | None = None,
    fault: InjectedFault | None = None,
    seed: int = 0,
    at: tuple[RobotModel, str] | None = None,
) -> tuple[SimulatedSensor, Mounting]:
    """Put a cheap inertial unit, 200 Hz, on a base; return it and the mounting that is told of it.

    It is at the base's origin, or where a robot has a frame (`at`), and begins at `start` [s] of the plant. Of the
    accelerometer's bias (3,) [m/s2], left by a calibration, the mounting knows nothing. Noise is the standard deviation
    of an axis of a reading [m/s2]; an MPU-6050's when None.
    """
    model = SensorModel()
    if noise is not None:
        if not 0.0 <= noise < np.inf:
            raise InputError(f"sensor noise: expected 0 or more m/s2, got {noise}")
        # white up to half the sampling rate
        model = replace(model, noise=noise / float(np.sqrt(0.5 * model.rate_hz)))
    told = model.mounting if at is None else model.mounting.at(*at)
    true = replace(told, bias=as_array("sensor bias", bias, (3,)))
    faults = () if fault is None else (fault,)
    sensor = SimulatedSensor(base, Mailbox(), replace(model, mounting=true), faults=faults, seed=seed, start=start)
    return sensor, told
