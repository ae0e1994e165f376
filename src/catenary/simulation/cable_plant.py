"""A simulated RAVEN-II arm: real cables, its own firmware, external encoders; homing, first joints alone, telemetry.

[Homing: RAVEN-II source, branch master, homing.cpp] Tools first, the positioning joints standing still; then the three
positioning joints together. An axis has met its stop, which registers its encoders, own and external ones, when the DAC
that its PD asks for reaches a threshold.
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
from catenary.simulation.cable_parameters import CableArm, Firmware, Rig, load_cable_arm, right_arm, varied
from catenary.simulation.cable_physics import ArmState, Work, unstretched_rotors
from catenary.simulation.firmware import (
    FOUND,
    SEEKING,
    ControlState,
    OwnGravity,
    TickLog,
    grav_dir_of,
    gravity_of,
    joint_torques,
    read_encoders,
    register,
    run_ticks,
)
from catenary.simulation.firmware_plant import AXIS_FIELDS, FirmwarePlant, columns_of, half_cosine
from catenary.simulation.records import OFF, POSITION, POSITIONING, TOOLS
from catenary.simulation.simulated_plant import PERIOD
from catenary.transmission.cable_elasticity import LARGEST_LOSS, winding_of

# [rad/s, rad/s, m/s, rad/s...] towards the stops: shoulder down, elbow up, insertion out, tools up
_SEEK_SPEEDS = np.array([-np.deg2rad(10.0), np.deg2rad(10.0), 0.02, *np.deg2rad([80.0, 40.0, 40.0, 40.0])])
_RAMP_S = 0.5  # [s] in which the speed rises as v (1 - cos 2 pi t)
_AMPLIFIER_WAIT_S = 1.0  # [s]
_REGISTER_WAIT_S = 0.2  # [s] from the last stop to the registration
_HOME_TIME_S = 2.5  # [s] of the half cosine to the home position
_MAX_SEEK_S = 60.0  # [s]
_POSITIONING_AXES = np.array([True] * 3 + [False] * 4)
_TOOL_AXES = ~_POSITIONING_AXES
Booleans = NDArray[np.bool_]
_AWAITED_AXES = np.array([False] * 3 + [True, True, True, False])  # the last jaw is not waited for


class ExternalEncoders:
    """Encoders that see the joints themselves, beyond the cables."""

    def __init__(self, rig: Rig) -> None:
        """Take the rig's numbers; the encoders are not registered."""
        self.rig = rig
        self.zero = np.full(3, np.nan)  # (3,) counts at which a joint is where `rig.registered` says

    def counts(self, q: Floats) -> Floats:
        """Return the counts at true joint positions (..., 3) [rad, rad, m]."""
        return np.round(q * self.rig.counts)

    def positions(self, counts: Floats) -> Floats:
        """Return the joint positions that the rig reports, (..., 3) [rad, rad, m]; NaN before it is registered."""
        return np.asarray(self.rig.registered + (counts - self.zero) / self.rig.counts)


def mean_near_peak(counts: Floats, side: Floats, window: Floats) -> Floats:
    """Return the mean (3,) of the counts (T, 3) within a window (3,) of their peaks on the given sides (3,)."""
    peak = np.max(counts * side, axis=0) * side
    near = np.abs(counts - peak) <= window
    return np.asarray(np.where(near, counts, 0.0).sum(axis=0) / near.sum(axis=0))


def home(
    firmware: Firmware, control: ControlState, arm: ArmState, encoders: ExternalEncoders, stop_side: Floats,
    joint_names: Sequence[str],
) -> Iterator[Floats]:  # fmt: skip
    """Home an arm, tick by tick: each item is the next row of setpoints (7,); the rest is written to control.

    The rig's encoders are registered at the stops of the positioning joints, on stop_side (3,), -1 for one below: at
    the mean of the counts near their peak.
    """
    control.guarded = False  # the stops lie beyond the software limits
    control.mode[:] = POSITION
    hold = control.joint.copy()
    for _ in range(round(_AMPLIFIER_WAIT_S / PERIOD)):
        yield hold
    yield from _seek(control, _TOOL_AXES, _AWAITED_AXES, joint_names)
    register(firmware, control, np.where(_TOOL_AXES, firmware.stop_value, firmware.home_value))
    yield from half_cosine(control.joint.copy(), np.where(_TOOL_AXES, firmware.home_value, control.joint), _HOME_TIME_S)
    seen = []
    for wanted in _seek(control, _POSITIONING_AXES, _POSITIONING_AXES, joint_names):
        yield wanted
        seen.append(encoders.counts(arm.q))
    encoders.zero = mean_near_peak(np.array(seen), stop_side, encoders.rig.window)
    register(firmware, control, np.where(_POSITIONING_AXES, firmware.stop_value, control.joint))
    yield from half_cosine(
        control.joint.copy(), np.where(_POSITIONING_AXES, firmware.home_value, control.joint), _HOME_TIME_S
    )


def _seek(control: ControlState, axes: Booleans, waited_for: Booleans, joint_names: Sequence[str]) -> Iterator[Floats]:
    """Run axes towards their stops until those waited for have met them, and a moment longer."""
    wanted, seek, setpoint = control.joint.copy(), control.seek, control.setpoint
    seek[axes] = SEEKING
    t, since = 0.0, 0.0
    while since < _REGISTER_WAIT_S:
        ramp = 1.0 - np.cos(2.0 * np.pi * t) if t < _RAMP_S else 1.0
        found = seek == FOUND
        moving = axes & ~found
        wanted = np.where(moving, wanted + _SEEK_SPEEDS * ramp * PERIOD, np.where(found, setpoint, wanted))
        yield wanted
        t += PERIOD
        if (found | ~waited_for).all():
            since += PERIOD
        if t > _MAX_SEEK_S:
            lost = [joint_names[int(j)] for j in np.flatnonzero(waited_for & ~found)]
            raise NotReadyError(f"homing: {', '.join(lost)} met no stop in {_MAX_SEEK_S:g} s")
    seek[:] = OFF


_REPORTED_FIELDS = {  # name in telemetry: field of the firmware's state, unit
    **AXIS_FIELDS,
    "mpos_d": ("motor_setpoint", "rad"),
    "tau": ("torque", "Nm at the gearbox's output"),
    "dac_val": ("dac", "DAC"),
    "encoffsets": ("offset", "counts"),
}
# between which an arm stands at power-on [rad, rad, m]
_START_ENDS = [*np.deg2rad([10.0, 60.0]), 0.30], [*np.deg2rad([70.0, 120.0]), 0.45]
_PAYLOAD_PLACE = np.array([0.0, 0.0, -0.47])  # [m] in the insertion's frame: the tool's wrist


class CablePlant(FirmwarePlant[TickLog]):
    """One arm. Nothing moves before it is homed and enabled; brakes hold it while it is not enabled."""

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
        """Put an arm on a base.

        Args:
            arm: The package's RAVEN-II when None.
            side: "left" (gold) or "right" (green).
            seed: Draws another robot of the kind and where it stands; None is the nominal one, always at one place.
            start: (3,) where the positioning joints stand at power-on [rad, rad, m], in place of a drawn one.
            payload: Mass at the tool's wrist [kg].
            base: A level base at rest when None.
            substeps: Physics steps in 1 ms; 1 is enough for hours-long runs.
            grav_dir: Gravity that its own compensation goes by, three whole numbers [cm/s2] as the robot has them,
                z down: (0, 0, 980) on the real one, on whatever base. No compensation of its own when None.
        """
        if side not in ("left", "right"):
            raise InputError(f'side "{side}": expected left or right')
        rng = np.random.default_rng(0 if seed is None else seed)
        drawn = load_cable_arm() if arm is None else arm
        drawn = drawn if seed is None else varied(drawn, rng)
        self.arm = drawn if side == "left" else right_arm(drawn)
        super().__init__(base, substeps)
        self.side, self.seed = side, seed
        self.model: RobotModel = load_robot("raven2_full" if side == "left" else "raven2_full_right")
        positioning = load_robot("raven2" if side == "left" else "raven2_right")
        self._positioning, self._links = positioning, _writable(positioning.tree)
        self.carry(payload)
        # the arm's parameters and the firmware's; others may be put in place of them
        self.cable, self.firmware = self.arm.cable.copy(), self.arm.firmware.copy()
        self.state = ArmState()
        self.control = ControlState(braked=True, guarded=True)
        self.encoders = ExternalEncoders(self.arm.rig)
        self._own_gravity = OwnGravity()
        self.switch_own_gravity(grav_dir)
        self._work = Work()
        self._power_on(rng, start)

    # what a Plant says about itself

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
        """Gravity that the robot's own compensation goes by [cm/s2], z down; None without compensation.

        May be set, as a program on the robot may: it holds until the arm is disabled or homes, and is then what it
        was at the beginning.
        """
        return grav_dir_of(self._own_gravity.gravity) if self._compensates else None

    @grav_dir.setter
    def grav_dir(self, grav_dir: Sequence[float]) -> None:
        gravity = gravity_of(grav_dir)
        if not self._compensates:
            raise InputError("grav_dir: this robot was made without gravity compensation of its own")
        if self._own_gravity.weighs:
            self._own_gravity.gravity = gravity

    def switch_own_gravity(self, grav_dir: Sequence[float] | None) -> None:
        """Switch the robot's own gravity compensation on, by a gravity as `grav_dir` has it, or off.

        As if its program had been made so: it outlasts `disable` and homing. No topic of the robot's software does it.
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
        """Return where the external encoders see the positioning joints, (3,) [rad, rad, m]."""
        return self.encoders.positions(self.encoders.counts(self.state.q))

    # what only a simulator can do

    def carry(self, payload: float) -> None:
        """Carry a mass [kg] at the tool's wrist from now on, in place of the last one."""
        self.payload = float(as_not_negative("payload [kg]", payload, ()))
        self._tree = _writable(self._positioning.with_payload("insertion", payload, _PAYLOAD_PLACE).tree)

    def rub(self, factor: float) -> None:
        """Rub with so many times the arm's own Coulomb friction from now on, at rotors, idlers and joints."""
        factor = float(as_not_negative("friction, times the arm's own", factor, ()))
        for part in ("rotor", "node", "link"):
            for name in (f"{part}_friction", f"{part}_load_friction"):
                setattr(self.cable, name, factor * getattr(self.arm.cable, name))

    def wear(self, share: float) -> None:
        """Wear the cables: their permanent set and lost stiffness become a share, 0 to 1, of the largest there are."""
        if not 0.0 <= share <= 1.0:
            raise InputError(f"wear: expected a share from 0 to 1, got {share}")
        self.state.slack = share * self.cable.set_side * self.cable.largest_set
        self.state.loss = np.full(POSITIONING, share * LARGEST_LOSS)

    @property
    def identity(self) -> dict[str, object]:
        """What makes this arm another one than others of its kind."""
        return {"side": self.side, "seed": self.seed, "payload": self.payload}

    @property
    def registered(self) -> dict[str, Floats]:
        """What homing wrote besides `control`: (3,) counts at which the rig's encoders are registered."""
        return {"rig_zero": self.encoders.zero}

    def resume_at(self, tick: int, registered: Mapping[str, Floats], *, is_homed: bool) -> None:
        """Go on from a saved tick, disabled, with the rig registered as it was."""
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
        """Switch the robot's own gravity compensation: once homed, whether the pedal is down or not."""
        own = self._own_gravity
        if not self._is_homing:
            self.control.seek[:] = OFF
        runs = self._is_homed and not self._is_homing and self._state in ("ENABLED", "PAUSED")
        own.weighs = runs and self._compensates
        if not own.weighs:
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
    """Return a tree of arrays that can be written, as deep copies are: compiled code is made anew for another kind."""
    return Tree._make(np.array(part) for part in tree)


class PositioningArm:
    """A Plant of the positioning joints alone, as the robot model of the same name has; the firmware holds the tool.

    The robot compensates gravity for these alone, and its model has mass for these alone. What is not of joints, such
    as the operating state, telemetry and the clock, is the arm's own.
    """

    def __init__(self, arm: CablePlant) -> None:
        """Take an arm; commands to it and to this one reach the same joints."""
        self.arm = arm

    def __getattr__(self, name: str) -> Any:
        if name == "arm":  # while a copy is made
            raise AttributeError(name)
        value = getattr(self.arm, name)
        return value[:POSITIONING] if name in ("joint_names", "joint_units", "lower", "upper") else value

    @property
    def q_true(self) -> Floats:
        """Where the joints really are, (3,) [rad, rad, m]."""
        return self.arm.state.q.copy()

    def measured_js(self) -> JointState:
        """Return the joint state as the firmware believes it."""
        return _first(self.arm.measured_js())

    def setpoint_js(self) -> JointState:
        """Return the joint setpoint of the firmware."""
        return _first(self.arm.setpoint_js())

    def servo_jp(self, q: Floats) -> None:
        """Move the setpoint towards q (3,)."""
        wanted = as_array("servo_jp", q, (POSITIONING,))
        self.arm.servo_jp(np.concatenate([wanted, self.arm.control.setpoint[POSITIONING:]]))

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
# name in telemetry: field of a tick's log, which has no offsets of the encoders
_AXIS_FIELDS = {name: field for name, (field, _) in _REPORTED_FIELDS.items() if name != "encoffsets"}
COLUMNS = (
    *_AXIS_FIELDS, "encoffsets", "runlevel", "type", "dt", "pos", "ori", "ext_jpos", "joint_enc",
    "measured_js", "measured_js_velocity", "measured_js_effort",
)  # fmt: skip


def as_reported(plant: CablePlant, values: Floats) -> Floats:
    """Return values with the digits that the robot's messages have."""
    return values.astype(plant.arm.file.reported).astype(np.float64)


def of_both_arms(
    plant: CablePlant, log: TickLog, beside: CablePlant | None, log_beside: TickLog | None
) -> dict[str, Floats]:
    """Return `telemetry_of` an arm with the channels and the pose of another beside it, of the same ticks."""
    columns = telemetry_of(plant, log)
    if beside is not None and log_beside is not None:
        others = telemetry_of(beside, log_beside)
        columns |= {name: columns[name] + others[name] for name in (*_AXIS_FIELDS, "encoffsets", "pos", "ori")}
    return columns


def telemetry_of(plant: CablePlant, log: TickLog) -> dict[str, Floats]:
    """Return T ticks of a run as telemetry: column name to (T, width), SI.

    `pos` and `ori` are the tool's pose in the arm's frame 0, as the robot believes it from its motors.
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
