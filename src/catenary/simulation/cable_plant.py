"""Simulated RAVEN-II arm: elastic cables, firmware, external encoders, homing, positioning joints, telemetry.

[Homing: RAVEN-II source, branch master, homing.cpp] The tool axes are homed first, with the positioning joints at rest;
then the three positioning joints together. An axis has reached its stop when the DAC value of its PD reaches a
threshold; there its motor encoder and external encoder are registered.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, NotReadyError
from catenary.plant import Column, JointState
from catenary.raven2.topics import ARM_OF_SIDE, JOINTS, UNITS, in_channels
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel, Tree
from catenary.simulation.base_motion import BaseSamples, MovingBase
from catenary.simulation.cable_parameters import CableArm, Firmware, Rig, load_cable_arm, right_arm, varied_arm
from catenary.simulation.cable_physics import ArmState, Work, unstretched_rotors
from catenary.simulation.compiled_records import OFF, POSITION, POSITIONING, TOOLS
from catenary.simulation.firmware import (
    STOP_FOUND,
    STOP_SOUGHT,
    ControlState,
    OwnGravity,
    TickLog,
    grav_dir_of,
    gravity_of,
    joint_torques,
    read_encoders,
    register_encoders,
    run_ticks,
)
from catenary.simulation.firmware_plant import AXIS_FIELDS, FirmwarePlant, columns_of, half_cosine
from catenary.simulation.simulated_plant import PERIOD
from catenary.transmission.cable_elasticity import MAX_LOSS, winding_of

# [rad/s, rad/s, m/s, rad/s...] towards the stops: shoulder down, elbow up, insertion out, tools up
_SEEK_SPEEDS = np.array([-np.deg2rad(10.0), np.deg2rad(10.0), 0.02, *np.deg2rad([80.0, 40.0, 40.0, 40.0])])
_RAMP_S = 0.5  # [s] in which the speed rises as v (1 - cos 2 pi t)
_AMPLIFIER_WAIT_S = 1.0  # [s]
_REGISTER_WAIT_S = 0.2  # [s] from the last stop to the registration
_HOME_TIME_S = 2.5  # [s] duration of the half cosine to the home position
_MAX_SEEK_S = 60.0  # [s]
_POSITIONING_AXES = np.array([True] * 3 + [False] * 4)
_TOOL_AXES = ~_POSITIONING_AXES
Booleans = NDArray[np.bool_]
_AWAITED_AXES = np.array([False] * 3 + [True, True, True, False])  # homing does not wait for the last jaw


class ExternalEncoders:
    """Encoders at the joints, beyond the cables; initially not registered."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.zero = np.full(3, np.nan)  # (3,) counts at `rig.registered`

    def counts(self, q: Floats) -> Floats:
        """Return the counts at true joint positions (..., 3) [rad, rad, m]."""
        rig = self.rig
        return np.round((q + rig.eccentricity * np.cos(q - rig.eccentric_phase)) * rig.counts)

    def positions(self, counts: Floats) -> Floats:
        """Return the joint positions (..., 3) [rad, rad, m] of counts; NaN before registration."""
        return np.asarray(self.rig.registered + (counts - self.zero) / self.rig.counts)


def mean_near_peak(counts: Floats, side: Floats, window: Floats) -> Floats:
    """Return the mean (3,) of counts (T, 3) within a window (3,) of their maxima, or minima where side (3,) is -1."""
    peak = np.max(counts * side, axis=0) * side
    in_window = np.abs(counts - peak) <= window
    return np.asarray(np.where(in_window, counts, 0.0).sum(axis=0) / in_window.sum(axis=0))


def home(
    firmware: Firmware, control: ControlState, arm: ArmState, encoders: ExternalEncoders, stop_side: Floats,
    joint_names: Sequence[str],
) -> Iterator[Floats]:  # fmt: skip
    """Home an arm tick by tick: yield the next setpoints (7,) [rad, rad, m, rad...], and update `control`.

    The external encoders are registered at the stops of the positioning joints, by the mean of the counts near their
    peak; stop_side (3,) is 1 for an upper stop and -1 for a lower one.
    """
    control.guarded = False  # the stops are beyond the software limits
    control.mode[:] = POSITION
    hold = control.joint.copy()
    for _ in range(round(_AMPLIFIER_WAIT_S / PERIOD)):
        yield hold
    yield from _seek(control, _TOOL_AXES, _AWAITED_AXES, joint_names)
    register_encoders(firmware, control, np.where(_TOOL_AXES, firmware.stop_value, firmware.home_value))
    yield from half_cosine(control.joint.copy(), np.where(_TOOL_AXES, firmware.home_value, control.joint), _HOME_TIME_S)
    seen = []
    for setpoint in _seek(control, _POSITIONING_AXES, _POSITIONING_AXES, joint_names):
        yield setpoint
        seen.append(encoders.counts(arm.q))
    encoders.zero = mean_near_peak(np.array(seen), stop_side, encoders.rig.window)
    register_encoders(firmware, control, np.where(_POSITIONING_AXES, firmware.stop_value, control.joint))
    yield from half_cosine(
        control.joint.copy(), np.where(_POSITIONING_AXES, firmware.home_value, control.joint), _HOME_TIME_S
    )


def _seek(control: ControlState, axes: Booleans, waited_for: Booleans, joint_names: Sequence[str]) -> Iterator[Floats]:
    """Move axes towards their stops until `_REGISTER_WAIT_S` after the awaited ones have reached them."""
    target, seek, setpoint = control.joint.copy(), control.seek, control.setpoint
    seek[axes] = STOP_SOUGHT
    t, since = 0.0, 0.0
    while since < _REGISTER_WAIT_S:
        ramp = 1.0 - np.cos(2.0 * np.pi * t) if t < _RAMP_S else 1.0
        at_stop = seek == STOP_FOUND
        moving = axes & ~at_stop
        target = np.where(moving, target + _SEEK_SPEEDS * ramp * PERIOD, np.where(at_stop, setpoint, target))
        yield target
        t += PERIOD
        if (at_stop | ~waited_for).all():
            since += PERIOD
        if t > _MAX_SEEK_S:
            lost = [joint_names[int(j)] for j in np.flatnonzero(waited_for & ~at_stop)]
            raise NotReadyError(f"homing: {', '.join(lost)} reached no stop in {_MAX_SEEK_S:g} s")
    seek[:] = OFF


_REPORTED_FIELDS = {  # name in telemetry: field of the firmware's state, unit
    **AXIS_FIELDS,
    "mpos_d": ("motor_setpoint", "rad"),
    "tau": ("torque", "Nm at the gearbox's output"),
    "dac_val": ("dac", "DAC"),
    "encoffsets": ("offset", "counts"),
}
# range of the positions at power-on [rad, rad, m]
_START_ENDS = [*np.deg2rad([10.0, 60.0]), 0.30], [*np.deg2rad([70.0, 120.0]), 0.45]
_PAYLOAD_PLACE = np.array([0.0, 0.0, -0.47])  # [m] in the insertion's frame: the tool's wrist


class CablePlant(FirmwarePlant[TickLog]):
    """Simulated RAVEN-II arm, which must be homed and enabled to move; brakes hold it otherwise.

    Examples:
        >>> plant = catenary.CablePlant()
        >>> plant.home()
        >>> log = plant.run(np.tile(plant.setpoint_js().q, (100, 1)))
        >>> log.joint.shape
        (100, 7)
    """

    def __init__(
        self,
        arm: CableArm | None = None,
        *,
        side: str = "left",
        seed: int | None = None,
        start: ArrayLike | None = None,
        payload: float = 0.0,
        base: MovingBase | None = None,
        substeps: int = 2,
        grav_dir: Sequence[float] | None = None,
    ) -> None:
        """Create an arm, powered on and disabled.

        Args:
            arm: Parameters; the package's RAVEN-II if None.
            side: "left" (gold) or "right" (green).
            seed: Seed of random parameters and start; None for the nominal robot at a fixed start.
            start: (3,) positions of the positioning joints at power-on [rad, rad, m]; drawn if None.
            payload: Mass at the tool's wrist [kg], 0 or more.
            base: Motion of the base; level and fixed if None.
            substeps: Physics steps per millisecond; 1 is accurate enough for runs of hours.
            grav_dir: Gravity of the firmware's own compensation, three integers [cm/s2] with z down; (0, 0, 980) on the
                real robot at any mounting. No compensation if None.
        """
        if side not in ("left", "right"):
            raise InputError(f'side "{side}": expected left or right')
        rng = np.random.default_rng(0 if seed is None else seed)
        drawn = load_cable_arm() if arm is None else arm
        drawn = drawn if seed is None else varied_arm(drawn, rng)
        self.arm = drawn if side == "left" else right_arm(drawn)
        super().__init__(base, substeps)
        self.side, self.seed = side, seed
        self.model: RobotModel = load_robot("raven2_full" if side == "left" else "raven2_full_right")
        positioning = load_robot("raven2" if side == "left" else "raven2_right")
        self._positioning, self._links = positioning, _writable(positioning.tree)
        self.carry(payload)
        # copies of the parameters of arm and firmware, which may be changed
        self.cable, self.firmware = self.arm.cable.copy(), self.arm.firmware.copy()
        self.state = ArmState()
        self.control = ControlState(braked=True, guarded=True)
        self.encoders = ExternalEncoders(self.arm.rig)
        self._own_gravity = OwnGravity()
        self.switch_own_gravity(grav_dir)
        self._work = Work()
        self._power_on(rng, start)

    # properties of a Plant

    joint_names: tuple[str, ...] = JOINTS
    joint_units: tuple[str, ...] = UNITS
    reported = _REPORTED_FIELDS
    columns = columns_of(
        _REPORTED_FIELDS,
        Column("joint_enc", "counts", POSITIONING),
        Column("ext_jpos", "rad|m", POSITIONING),
        Column("q_true", "rad|m", POSITIONING),
    )
    log = TickLog
    stops_when = "the software e-stop tripped at {time}: a motor's command was too large"

    @property
    def grav_dir(self) -> tuple[int, int, int] | None:
        """Gravity of the firmware's own compensation [cm/s2], z down; None without compensation.

        It can be set, as by a program on the robot, and returns to its initial value when the arm is disabled or homed.
        """
        return grav_dir_of(self._own_gravity.gravity) if self._compensates else None

    @grav_dir.setter
    def grav_dir(self, grav_dir: Sequence[float]) -> None:
        gravity = gravity_of(grav_dir)
        if not self._compensates:
            raise InputError("grav_dir: this robot was made without gravity compensation of its own")
        if self._own_gravity.is_enabled:
            self._own_gravity.gravity = gravity

    def switch_own_gravity(self, grav_dir: Sequence[float] | None) -> None:
        """Enable the firmware's own gravity compensation, with gravity in the format of `grav_dir`; None disables it.

        It persists through `disable` and homing, as if compiled into the firmware.
        """
        self._written_gravity = np.zeros(3) if grav_dir is None else gravity_of(grav_dir)
        self._compensates = grav_dir is not None
        self._own_gravity.gravity = self._written_gravity
        self._state_or_homing_changed()

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""
        counts = self.encoders.counts(self.state.q)
        positions = self.encoders.positions(counts)
        return self._sample(joint_enc=counts, ext_jpos=positions, q_true=self.state.q.copy())

    def external_encoders(self) -> Floats:
        """Return the external encoders' positions of the positioning joints (3,) [rad, rad, m]."""
        return self.encoders.positions(self.encoders.counts(self.state.q))

    # simulator only

    def carry(self, payload: float) -> None:
        """Replace the mass at the tool's wrist [kg]."""
        self.payload = float(as_not_negative("payload [kg]", payload, ()))
        self._tree = _writable(self._positioning.with_payload("insertion", payload, _PAYLOAD_PLACE).tree)

    def set_coulomb_friction(self, factor: float) -> None:
        """Set Coulomb friction of rotors, idlers and joints to a multiple of the arm's own, 0 or more."""
        factor = float(as_not_negative("friction, times the arm's own", factor, ()))
        for part in ("rotor", "node", "link"):
            for name in (f"{part}_friction", f"{part}_load_friction"):
                setattr(self.cable, name, factor * getattr(self.arm.cable, name))

    def wear(self, share: float) -> None:
        """Wear the cables: set their elongation and loss of stiffness to a share, 0 to 1, of the limits."""
        if not 0.0 <= share <= 1.0:
            raise InputError(f"wear: expected a share from 0 to 1, got {share}")
        self.state.slack = share * self.cable.set_side * self.cable.largest_set
        self.state.loss = np.full(POSITIONING, share * MAX_LOSS)

    @property
    def identity(self) -> dict[str, object]:
        """Parameters that distinguish this arm from others of its kind."""
        return {"side": self.side, "seed": self.seed, "payload": self.payload}

    @property
    def registered(self) -> dict[str, Floats]:
        """Registration besides `control`: (3,) counts of the external encoders at `rig.registered`."""
        return {"rig_zero": self.encoders.zero}

    def resume_at(self, tick: int, registered: Mapping[str, Floats], *, is_homed: bool) -> None:
        """Resume from a saved tick, disabled, with the saved registration of the external encoders."""
        self.encoders.zero = registered["rig_zero"].copy()
        super().resume_at(tick, registered, is_homed=is_homed)

    def _run_ticks(self, rows: Floats, base: BaseSamples, log: TickLog) -> int:
        return run_ticks(
            self._tree, self._links, self.cable, self.firmware, self.state, self.control, self._own_gravity,
            self._work, rows, base.gravity, base.motion, self.substeps, log,
        )  # fmt: skip

    def _joint_torques(self) -> Floats:
        return joint_torques(self.firmware, self.control.torque)

    def _homing_rows(self) -> Iterator[Floats]:
        return home(self.firmware, self.control, self.state, self.encoders, self.cable.stop_side, self.joint_names)

    def _state_or_homing_changed(self) -> None:
        """Enable the firmware's own gravity compensation once homed, with the pedal up or down."""
        own = self._own_gravity
        if not self._is_homing:
            self.control.seek[:] = OFF
        runs = self._is_homed and not self._is_homing and self._state in ("ENABLED", "PAUSED")
        own.is_enabled = runs and self._compensates
        if not own.is_enabled:
            self.control.gravity_torque[:] = 0.0
            own.gravity = self._written_gravity

    def _power_on(self, rng: np.random.Generator, start: ArrayLike | None) -> None:
        state = self.state
        state.q = rng.uniform(*_START_ENDS) if start is None else as_array("start", start, (POSITIONING,))
        state.rotor[:POSITIONING] = unstretched_rotors(
            self.cable, state.q, np.array(winding_of(self.cable.coupling, state.q))
        )
        tools = rng.uniform(-0.5, 0.5, TOOLS)
        insertion = state.rotor[POSITIONING - 1]
        state.rotor[POSITIONING:] = self.cable.tool_ratio * tools + self.cable.tool_carried * insertion
        self._wake_encoders(rng, 2e5, lambda: read_encoders(self.firmware, state, self.control))


def _writable(tree: Tree) -> Tree:
    """Return a tree of writable arrays, as deep copies are; numba compiles again for read-only ones."""
    return Tree._make(np.array(part) for part in tree)


class PositioningArm:
    """A Plant of only an arm's positioning joints, as in robot model `raven2`; the firmware holds the tool.

    Operating state, telemetry and clock are the arm's.
    """

    def __init__(self, arm: CablePlant) -> None:
        self.arm = arm

    def __getattr__(self, name: str) -> Any:
        if name == "arm":  # while a copy is made
            raise AttributeError(name)
        value = getattr(self.arm, name)
        return value[:POSITIONING] if name in ("joint_names", "joint_units", "lower", "upper") else value

    @property
    def q_true(self) -> Floats:
        """True joint positions (3,) [rad, rad, m]."""
        return self.arm.state.q.copy()

    def measured_js(self) -> JointState:
        """Return the joint state that the firmware reports."""
        return _first(self.arm.measured_js())

    def setpoint_js(self) -> JointState:
        """Return the joint setpoint of the firmware."""
        return _first(self.arm.setpoint_js())

    def servo_jp(self, q: Floats) -> None:
        """Move the setpoint towards q (3,)."""
        target = as_array("servo_jp", q, (POSITIONING,))
        self.arm.servo_jp(np.concatenate([target, self.arm.control.setpoint[POSITIONING:]]))

    def servo_jr(self, dq: Floats) -> None:
        """Move the setpoint by dq (3,)."""
        step = as_array("servo_jr", dq, (POSITIONING,))
        self.arm.servo_jr(np.concatenate([step, np.zeros(len(self.arm.joint_names) - POSITIONING)]))

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques (3,) [Nm, Nm, N]; the tool is held."""
        self.arm.servo_jf(as_array("servo_jf", tau, (POSITIONING,)))


def _first(state: JointState) -> JointState:
    n = POSITIONING
    return state._replace(q=state.q[:n], qd=state.qd[:n], tau=state.tau[:n], q_motor=state.q_motor[:n])


_RUNNING_LEVEL = 3  # run level: pedal down
# name in telemetry: field of a tick's log, which lacks encoder offsets
_AXIS_FIELDS = {name: field for name, (field, _) in _REPORTED_FIELDS.items() if name != "encoffsets"}
COLUMNS = (
    *_AXIS_FIELDS, "encoffsets", "runlevel", "type", "dt", "pos", "ori", "ext_jpos", "joint_enc",
    "measured_js", "measured_js_velocity", "measured_js_effort",
)  # fmt: skip


def as_reported(plant: CablePlant, values: Floats) -> Floats:
    """Round values to the floating-point type of the robot's messages.

    Args:
        plant: Arm whose file defines the type.
    """
    return values.astype(plant.arm.file.reported).astype(np.float64)


def of_both_arms(
    plant: CablePlant, log: TickLog, other: CablePlant | None, other_log: TickLog | None
) -> dict[str, Floats]:
    """Return the telemetry of one or two arms in the robot's channels, columns as in `telemetry_of`.

    Args:
        plant: Arm whose columns without channels are kept.
        log: Its T ticks.
        other, other_log: Other arm, if any, and its log of the same ticks.
    """
    columns = telemetry_of(plant, log)
    if other is not None and other_log is not None:
        others = telemetry_of(other, other_log)
        columns |= {name: columns[name] + others[name] for name in (*_AXIS_FIELDS, "encoffsets", "pos", "ori")}
    return columns


def telemetry_of(plant: CablePlant, log: TickLog) -> dict[str, Floats]:
    """Return a run as telemetry, columns (T, width) by name, in SI.

    `pos` and `ori` are the tool's pose in frame 0 of the arm, computed from motor positions as on the robot.

    Args:
        plant, log: The arm, and its T ticks.
    """
    ticks = len(log.joint)
    side = ARM_OF_SIDE[plant.side]
    columns = {name: in_channels(side, as_reported(plant, getattr(log, field))) for name, field in _AXIS_FIELDS.items()}
    columns["encoffsets"] = in_channels(side, np.tile(plant.control.offset, (ticks, 1)))
    columns["runlevel"] = np.full((ticks, 1), float(_RUNNING_LEVEL))
    columns["type"] = np.zeros((ticks, 2))
    columns["dt"] = np.full((ticks, 1), plant.period)
    arm = tuple(ARM_OF_SIDE).index(plant.side)
    base, q = plant.model.frames["frame0"].pose, np.column_stack([log.joint[:, :5], 0.5 * np.diff(log.joint[:, 5:])])
    rotation, position = forward_kinematics(plant.model, q)
    positions, rotations = np.zeros((ticks, 2, 3)), np.zeros((ticks, 2, 3, 3))  # of both arms
    positions[:, arm], rotations[:, arm] = (position - base.position) @ base.rotation, base.rotation.T @ rotation
    columns["pos"], columns["ori"] = positions.reshape(ticks, 6), rotations.reshape(ticks, 18)
    columns["joint_enc"] = plant.encoders.counts(log.q)
    columns["ext_jpos"] = plant.encoders.positions(columns["joint_enc"])
    columns["measured_js"] = log.joint
    columns["measured_js_velocity"] = log.joint_velocity
    columns["measured_js_effort"] = joint_torques(plant.firmware, log.torque)
    return columns
