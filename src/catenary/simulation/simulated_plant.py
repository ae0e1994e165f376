"""Base class of simulated robots: ticks of 1 ms, a base, CRTK operating states; and pacing in real time."""

import time
from abc import ABC, abstractmethod
from typing import Any

from catenary.arrays import Floats, as_array
from catenary.errors import NotReadyError, UnsupportedCommandError
from catenary.plant import (
    STATE_COMMANDS,
    TRANSITIONS,
    Column,
    JointState,
    OperatingState,
    Plant,
    StateCommand,
    StateName,
)
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, MovingBase

PERIOD = 1e-3  # [s]


class SimulatedPlant(ABC):
    """Robot in simulated time; brakes hold it while it is not enabled and homed."""

    period = PERIOD
    simulated = True
    supports = frozenset({"servo_jp", "servo_jr", "servo_jf", "state_command"})
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    columns: tuple[Column, ...]  # of telemetry

    def __init__(self, base: BaseTimeline, *, is_homed: bool) -> None:
        self._base = base
        self._tick = 0
        self._state: StateName = "DISABLED"
        self._fault = ""  # reason of FAULT
        self._is_homed = is_homed
        self._target: Floats | None = None  # (n,) position command of the next tick

    @property
    def base(self) -> MovingBase:
        """Motion of the robot's base."""
        return self._base.base

    def set_base(self, base: MovingBase) -> None:
        """Replace the base; one that continues the motion of the last one causes no jolt."""
        self._base = BaseTimeline(base, self._base.period)

    @property
    def time(self) -> float:
        """Time since power-on [s]."""
        return self._tick * PERIOD

    @property
    def ticks(self) -> int:
        """Ticks since power-on."""
        return self._tick

    @property
    def fault_reason(self) -> str:
        """Reason of state FAULT; empty in other states."""
        return self._fault if self._state == "FAULT" else ""

    @abstractmethod
    def measured_js(self) -> JointState:
        """Return the joint state that the robot reports, with gravity and base rates of an ideal sensor."""

    @abstractmethod
    def setpoint_js(self) -> JointState:
        """Return the setpoint of the robot's own position control."""

    def servo_jp(self, q: Floats) -> None:
        """Move the setpoint to q (n,) [rad|m] in the next tick, within its limits."""
        self._require_ready()
        self._target = as_array("servo_jp", q, (len(self.joint_names),)).copy()
        self._control_position()

    def servo_jr(self, dq: Floats) -> None:
        """Move the setpoint by dq (n,) [rad|m], within its limits; commands in the same tick add up."""
        self._require_ready()
        start = self.setpoint_js().q if self._target is None else self._target
        self._target = start + as_array("servo_jr", dq, (len(self.joint_names),))
        self._control_position()

    def operating_state(self) -> OperatingState:
        """Return CRTK's operating state."""
        return OperatingState(self._state, self._is_homed, self._is_homing)

    def state_command(self, command: StateCommand) -> None:
        """Request a transition: enable, disable, pause, resume, home, unhome."""
        if command not in STATE_COMMANDS:
            raise UnsupportedCommandError(f'state command "{command}": expected one of {", ".join(STATE_COMMANDS)}')
        if command == "home":
            if self._state != "ENABLED":
                raise NotReadyError(f"home: the robot is {self._state}; enable it first")
            self._begin_homing()
        elif command == "unhome":
            self._is_homed = False
            self._unhomed()
        elif self._state in TRANSITIONS[command]:
            self._set_state(TRANSITIONS[command][self._state])

    def home(self) -> None:
        """Enable and home, faster than real time."""
        self.state_command("enable")
        self.state_command("home")
        while self._is_homing:
            self.wait()

    @abstractmethod
    def wait(self) -> None:
        """Advance by one tick of 1 ms."""

    @property
    def _is_homing(self) -> bool:
        return False

    @property
    def _moves(self) -> bool:
        """Brakes are off and control is active."""
        return self._state == "ENABLED" and self._is_homed

    def _set_state(self, state: StateName, why: str = "") -> None:
        self._state, self._fault = state, why
        self._state_changed()

    def _base_now(self) -> BaseSamples:  # one row
        return self._base.rows(self._tick, 1)[0]

    def _joint_state(self, q: Floats, qd: Floats, tau: Floats, q_motor: Floats) -> JointState:
        gravity, motion = self._base_now()
        # an accelerometer measures gravity minus the acceleration of the base
        return JointState(self.time, q, qd, tau, q_motor, gravity[0] - motion[0, 2], 0.0, motion[0, :2].copy())

    @abstractmethod
    def _control_position(self) -> None:
        """Switch from torque control to position control."""

    @abstractmethod
    def _state_changed(self) -> None:
        """Set brakes and control modes by the operating state."""

    @abstractmethod
    def _begin_homing(self) -> None: ...

    @abstractmethod
    def _unhomed(self) -> None: ...

    def _require_ready(self) -> None:
        if not self._moves or self._is_homing:
            homed = "homing" if self._is_homing else "homed" if self._is_homed else "not homed"
            why = f": {self._fault}" if self._fault else ""
            raise NotReadyError(
                f"the robot is {self._state} and {homed}{why}; it must be ENABLED and homed to be moved"
            )


class PacedPlant:
    """A simulated plant in real time; the time of a late tick is not caught up."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._next: float | None = None
        self.late = 0  # ticks that began at least a period late

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def wait(self) -> None:
        """Advance the simulation, then sleep until the tick is over."""
        begin = time.monotonic()
        self._plant.wait()
        now = time.monotonic()
        period = self._plant.period
        if self._next is None or begin > self._next + period:
            self.late += self._next is not None
            self._next = begin
        self._next += period
        if self._next > now:
            time.sleep(self._next - now)
