"""A simulated RAVEN-II arm: real cables, its own firmware, homing, external encoders; a Plant."""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError, NotReadyError, UnsupportedCommandError
from catenary.plant import STATE_COMMANDS, JointState, OperatingState, StateCommand, StateName
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.simulation.base_motion import BaseTimeline, FixedBase, MovingBase
from catenary.simulation.cable_parameters import (
    POSITIONING,
    Cable,
    CableArm,
    Firmware,
    load_cable_arm,
    right_arm,
    varied,
)
from catenary.simulation.cable_physics import new_state, unstretched_rotors
from catenary.simulation.columns import COLUMNS, Sample, reported_positions, rounded_counts
from catenary.simulation.firmware import (
    BRAKES,
    GUARDED,
    OFF,
    PERIOD,
    POSITION,
    STOPPED,
    TORQUE,
    TickLog,
    new_control,
    read_encoders_of,
)
from catenary.simulation.homing import home, registered_zero
from catenary.simulation.joint_report import joint_state
from catenary.simulation.packed import LOG, arm_of, control_of, log_of, pack, pack_tree
from catenary.simulation.tick_call import TickArrays, TickCall, tick_call
from catenary.simulation.ticks import run_ticks

JOINTS = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")
UNITS = ("rad", "rad", "m", "rad", "rad", "rad", "rad")
NO_LOG = np.empty((0, LOG))
PAYLOAD_PLACE = np.array([0.0, 0.0, -0.47])  # [m] in the insertion's frame: the tool's wrist


class CablePlant:
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
    ) -> None:
        """Put an arm on a base.

        Args:
            arm: Its numbers; the package's RAVEN-II when None.
            side: "left" (gold) or "right" (green).
            seed: Draws another robot of the same kind and where it stands; when None the nominal one, always
                at the same place.
            start: (3,) where the positioning joints stand at power-on [rad, rad, m], in place of a drawn one.
            payload: Mass at the tool's wrist [kg].
            base: What it stands on; a level base at rest when None.
            substeps: Physics steps in 1 ms; 1 is enough for hours-long runs.

        Raises:
            InputError: A side that is none, a negative payload, or no substep.
        """
        if side not in ("left", "right"):
            raise InputError(f'side "{side}": expected left or right')
        if not payload >= 0.0 or not np.isfinite(payload):
            raise InputError(f"payload: expected zero or more kg, got {payload}")
        if substeps < 1:
            raise InputError(f"substeps: expected at least 1, got {substeps}")
        rng = np.random.default_rng(0 if seed is None else seed)
        drawn = load_cable_arm() if arm is None else arm
        drawn = drawn if seed is None else varied(drawn, rng)
        self.arm = drawn if side == "left" else right_arm(drawn)
        self.side, self.seed, self.substeps, self.payload = side, seed, substeps, payload
        self._base = BaseTimeline(FixedBase() if base is None else base, PERIOD)
        self.model: RobotModel = load_robot("raven2_full" if side == "left" else "raven2_full_right")
        self.rig = self.arm.rig
        positioning = load_robot("raven2" if side == "left" else "raven2_right")
        self._tree = positioning.with_payload("insertion", payload, PAYLOAD_PLACE).tree
        self._tree_numbers = pack_tree(self._tree)
        self._cable, self._firmware = self.arm.cable, self.arm.firmware
        self._parameters = pack(self._cable), pack(self._firmware)
        self._state_numbers = pack(new_state()), pack(new_control())
        self._whole_numbers = np.concatenate([a for a in new_control() if a.dtype == np.int64])
        self.state = arm_of(self._state_numbers[0])
        self.control = control_of(self._state_numbers[1], self._whole_numbers)
        self._tick_call: TickCall | None = None  # made at the first tick, for these very arrays
        self._tick = 0
        self._state: StateName = "DISABLED"
        self._fault = ""
        self._is_homed = False
        self._homing: Iterator[Floats] | None = None
        self._wanted = np.full(7, np.nan)
        self._rig_seen: list[Floats] | None = None
        self.rig_zero = np.full(3, np.nan)
        self._power_on(rng, start)

    def __deepcopy__(self, memo: dict[int, Any]) -> "CablePlant":
        """Another arm in the same state; its named arrays are views of its own long ones."""
        twin = object.__new__(CablePlant)
        memo[id(self)] = twin
        for name, value in vars(self).items():
            if name not in ("state", "control", "_tick_call"):
                setattr(twin, name, deepcopy(value, memo))
        twin.state = arm_of(twin._state_numbers[0])
        twin.control = control_of(twin._state_numbers[1], twin._whole_numbers)
        twin._tick_call = None
        return twin

    # what a Plant says about itself

    joint_names: tuple[str, ...] = JOINTS
    joint_units: tuple[str, ...] = UNITS
    period = PERIOD
    simulated = True
    supports = frozenset({"servo_jp", "servo_jr", "servo_jf", "state_command"})
    columns = COLUMNS

    @property
    def cable(self) -> Cable:
        """The arm's parameters; another set may be put in place of them."""
        return self._cable

    @cable.setter
    def cable(self, cable: Cable) -> None:
        self._cable = cable
        self._parameters = pack(cable), self._parameters[1]
        self._tick_call = None

    @property
    def firmware(self) -> Firmware:
        """The firmware's parameters; another set may be put in place of them."""
        return self._firmware

    @firmware.setter
    def firmware(self, firmware: Firmware) -> None:
        self._firmware = firmware
        self._parameters = self._parameters[0], pack(firmware)
        self._tick_call = None

    @property
    def lower(self) -> Floats:
        """Software limits below, (7,)."""
        return self.firmware.lower.copy()

    @property
    def upper(self) -> Floats:
        """Software limits above, (7,)."""
        return self.firmware.upper.copy()

    @property
    def base(self) -> MovingBase:
        """What the arm stands on."""
        return self._base.base

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._tick * PERIOD

    @property
    def ticks(self) -> int:
        """Ticks since power-on."""
        return self._tick

    def measured_js(self) -> JointState:
        """Joint state as the firmware believes it; gravity and rates of ideal sensors at the base's origin."""
        return self._joint_state(measured=True)

    def setpoint_js(self) -> JointState:
        """Joint setpoint of the firmware."""
        return self._joint_state(measured=False)

    def _joint_state(self, *, measured: bool) -> JointState:
        control, base = (self._state_numbers[1], self._whole_numbers), self._base.rows(self._tick, 1)[0]
        return joint_state(self.time, self._parameters[1], control, base, measured=measured)

    def operating_state(self) -> OperatingState:
        """CRTK's operating state."""
        return OperatingState(self._state, self._is_homed, self._homing is not None)

    def telemetry(self) -> Mapping[str, Floats]:
        """Latest sample of every column of `columns`."""
        return Sample(self, self._state_numbers[1].copy(), self._base.rows(self._tick, 1)[0])

    # what a Plant obeys

    def servo_jp(self, q: Floats) -> None:
        """Move the setpoint towards q (7,): at most one clamped step in a tick, within the software limits."""
        self._require_ready()
        self._wanted[:] = as_array("servo_jp", q, (7,))
        self.control.mode[:] = POSITION

    def servo_jr(self, dq: Floats) -> None:
        """Move the setpoint by dq (7,); several in a tick add up, then the clamp holds."""
        self._require_ready()
        start = np.where(np.isnan(self._wanted), self.control.setpoint, self._wanted)
        self._wanted[:] = start + as_array("servo_jr", dq, (7,))
        self.control.mode[:] = POSITION

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques, (7,), or (3,) for the positioning joints with the tool held, [Nm, Nm, N, Nm...].

        They hold until the next command, and the setpoint follows the arm meanwhile.
        """
        self._require_ready()
        n = POSITIONING if np.shape(tau) == (POSITIONING,) else len(JOINTS)
        torque = as_array("servo_jf", tau, (n,))
        self.control.torque_command[:n] = torque
        self.control.mode[:n] = TORQUE
        self.control.mode[n:] = POSITION

    def state_command(self, command: StateCommand) -> None:
        """Ask for a transition: enable, disable, pause, resume, home, unhome.

        Raises:
            UnsupportedCommandError: No such command.
        """
        if command not in STATE_COMMANDS:
            raise UnsupportedCommandError(
                f'state command "{command}": expected one of {", ".join(STATE_COMMANDS)}'
            )
        if command == "enable" and self._state in ("DISABLED", "FAULT"):
            self.control.flags[STOPPED] = 0
            self._set_state("ENABLED")
        elif command == "disable":
            self._set_state("DISABLED")
        elif command == "pause" and self._state == "ENABLED":
            self._set_state("PAUSED")
        elif command == "resume" and self._state == "PAUSED":
            self._set_state("ENABLED")
        elif command == "unhome":
            self._is_homed = False
        elif command == "home":
            if self._state != "ENABLED":
                raise NotReadyError(f"home: the arm is {self._state}; enable it first")
            self._stop_homing()
            self._is_homed = False
            self.control.flags[BRAKES] = 0
            self._homing = home(self)

    def wait(self) -> None:
        """Advance by one tick of 1 ms.

        Raises:
            NotReadyError: An axis that homes met no stop; the arm is then in FAULT.
        """
        row = self._wanted if self._homing is None else self._next_homing_row(self._homing)
        if self._tick_call is None:
            self._tick_call = tick_call(self._arrays(), self.substeps)
        base, _ = self._base.rows(self._tick, 1)
        self._tick_call(row, base.gravity, base.motion)
        self._tick += 1
        self._watch_stop()
        self._wanted[:] = np.nan
        if self._rig_seen is not None:
            self._rig_seen.append(self.rig_counts(self.state.q))

    # what only a simulator can do

    def home(self) -> None:
        """Enable and home, as fast as the machine runs."""
        if self._state != "ENABLED":
            self.state_command("enable")
        self.state_command("home")
        while self._homing is not None:
            self.wait()

    def run(self, setpoints: ArrayLike) -> TickLog:
        """Run a list of setpoints (T, 7), one a tick, in one compiled call, with the firmware inside.

        Equal, sample for sample, to `servo_jp` and `wait` for every row. NaN leaves that axis alone. Hours are run
        in pieces: the next call goes on where this one ended, bit for bit, and a log takes 528 B a tick.

        Raises:
            NotReadyError: Not homed, not enabled, or the software e-stop tripped on the way.
        """
        self._require_ready()
        rows = np.ascontiguousarray(setpoints, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != 7:
            raise InputError(f"run: expected setpoints of shape (T, 7), got {rows.shape}")
        if np.isinf(rows).any():
            raise InputError(f"run: setpoints are infinite on {np.isinf(rows).any(axis=1).sum()} rows")
        self.control.mode[:] = POSITION
        table = np.empty((len(rows), LOG))
        self._advance(rows, table)
        if self._state == "FAULT":
            raise NotReadyError(self._fault.removeprefix(": "))
        return log_of(table)

    def rig_counts(self, q: Floats) -> Floats:
        """Counts of the external encoders at true joint positions (..., 3)."""
        return rounded_counts(self.rig, q)

    def rig_positions(self, counts: Floats) -> Floats:
        """Joint positions that the rig reports, (..., 3) [rad, rad, m]; NaN before it is registered."""
        return reported_positions(self.rig, self.rig_zero, counts)

    def resume_at(self, tick: int, rig_zero: Floats, *, is_homed: bool) -> None:
        """Take up a life that was put away: the state's arrays have been written, the arm is disabled."""
        self._tick = tick
        self.rig_zero = rig_zero.copy()
        self._is_homed = is_homed
        self._set_state("DISABLED")

    def rig_peak_begin(self) -> None:
        """Begin to watch the external encoders for the stops."""
        self._rig_seen = []

    def rig_register(self) -> None:
        """Register the external encoders at the stops that they saw."""
        if self._rig_seen:
            self.rig_zero = registered_zero(self.rig, np.array(self._rig_seen), self.cable.stop_side)
        self._rig_seen = None

    def _advance(self, rows: Floats, log: Floats) -> None:
        done = 0
        while done < len(rows):
            base, count = self._base.rows(self._tick, len(rows) - done)
            given = rows[done : done + count], base.gravity, base.motion, self.substeps, log[done:]
            ran = run_ticks(*self._arrays(), *given)
            done, self._tick = done + ran, self._tick + ran
            if self._watch_stop():
                return

    def _arrays(self) -> TickArrays:
        """What compiled ticks read and write."""
        numbers = self._tree_numbers, *self._parameters, *self._state_numbers
        return self._tree.parent, self._tree.prismatic, *numbers, self._whole_numbers

    def _watch_stop(self) -> bool:
        """Whether the software e-stop has tripped."""
        tripped = bool(self.control.flags[STOPPED])
        if tripped:
            why = f"the software e-stop tripped at {self.time:.3f} s: a motor's command was too large"
            self._set_state("FAULT", f": {why}")
        return tripped

    def _next_homing_row(self, homing: Iterator[Floats]) -> Floats:
        try:
            row = next(homing, None)
        except NotReadyError as error:
            self._set_state("FAULT", f": {error}")
            raise
        if row is not None:
            return row
        self._stop_homing()
        self._is_homed = True
        return np.full(7, np.nan)  # the setpoint stays at home

    def _stop_homing(self) -> None:
        self._homing, self._rig_seen = None, None
        self.control.seek[:] = OFF
        self.control.flags[GUARDED] = 1

    def _set_state(self, state: StateName, why: str = "") -> None:
        self._state, self._fault = state, why  # `why` ends messages about the state
        self._stop_homing()
        running = state == "ENABLED" and self._is_homed
        self.control.flags[BRAKES] = 0 if running else 1
        self.control.mode[:] = POSITION if running else OFF
        if running:  # no jump when control begins
            self.control.setpoint[:] = self.control.joint

    def _require_ready(self) -> None:
        if self._state != "ENABLED" or not self._is_homed or self._homing is not None:
            homed = "homing" if self._homing is not None else "homed" if self._is_homed else "not homed"
            raise NotReadyError(
                f"the arm is {self._state} and {homed}{self._fault}; it must be ENABLED and homed to be moved"
            )

    def _power_on(self, rng: np.random.Generator, start: ArrayLike | None) -> None:
        low = np.array([np.deg2rad(10.0), np.deg2rad(60.0), 0.30])
        high = np.array([np.deg2rad(70.0), np.deg2rad(120.0), 0.45])
        q = rng.uniform(low, high) if start is None else as_array("start", start, (3,))
        self.state.q[:] = q
        self.state.rotor[:3] = unstretched_rotors(self.cable, q)
        tools = rng.uniform(-0.5, 0.5, 4)
        self.state.rotor[3:] = self.cable.tool_ratio * tools + self.cable.tool_carried * self.state.rotor[2]
        # the encoders count from wherever they woke up
        self.control.offset[:] = np.round(rng.uniform(-2e5, 2e5, 7))
        read_encoders_of(self.firmware, self.state, self.control)
        self.control.motor_velocity[:] = 0.0
        self.control.joint_velocity[:] = 0.0
        self.control.setpoint[:] = self.control.joint
