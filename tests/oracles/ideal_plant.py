"""A plant without physics: it is where its setpoint says, one tick later."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.errors import InputError, NotReadyError, UnsupportedCommandError
from catenary.plant import TRANSITIONS, Column, JointState, OperatingState, StateCommand
from catenary.robots.catalog import load_robot
from catenary.workflows.robot.operated_robot import OperatedRobot

Floats = NDArray[np.float64]


class IdealPlant:
    """Obeys the Plant protocol; `setpoints` keeps what it was sent, `pause_after` ticks it pauses by itself."""

    def __init__(
        self,
        q: Sequence[float],
        *,
        joint_names: Sequence[str] | None = None,
        joint_units: Sequence[str] | None = None,
        lower: Sequence[float] | None = None,
        upper: Sequence[float] | None = None,
        period: float = 0.001,
        ready: bool = True,
        pause_after: int | None = None,
        homing_ticks: int = 0,
        supports: frozenset[str] = frozenset({"measured_js", "setpoint_js", "servo_jp", "servo_jr"}),
    ) -> None:
        n = len(q)
        self.joint_names = tuple(joint_names or (f"joint{j}" for j in range(n)))
        self.joint_units = tuple(joint_units or ("rad",) * n)
        self.lower = np.array(lower if lower is not None else [-np.pi] * n)
        self.upper = np.array(upper if upper is not None else [np.pi] * n)
        self.period = period
        self.simulated = True
        self.supports = supports
        self.columns: tuple[Column, ...] = ()
        self.setpoints: list[Floats] = []
        self.ticks = 0
        self._pause_after = pause_after
        self._homing_ticks, self._homes_at = homing_ticks, -1
        self._q = np.array(q, dtype=float)
        self._qd = np.zeros(n)
        self._setpoint = self._q.copy()
        self._state = OperatingState("ENABLED" if ready else "DISABLED", ready, False)

    def measured_js(self) -> JointState:
        return self._joint_state(self._q, self._qd)

    def setpoint_js(self) -> JointState:
        return self._joint_state(self._setpoint, np.zeros_like(self._q))

    def servo_jp(self, q: Floats) -> None:
        self._require("servo_jp")
        if q.shape != self._q.shape:
            raise InputError(f"q: expected shape {self._q.shape}, got {q.shape}")
        self._setpoint = np.array(q)
        self.setpoints.append(self._setpoint.copy())

    def servo_jr(self, dq: Floats) -> None:
        self._require("servo_jr")
        self._setpoint = self._setpoint + dq
        self.setpoints.append(self._setpoint.copy())

    def servo_jf(self, tau: Floats) -> None:
        raise UnsupportedCommandError(f"servo_jf: expected one of {sorted(self.supports)}")

    def operating_state(self) -> OperatingState:
        return self._state

    def state_command(self, command: StateCommand) -> None:
        state, is_homed, is_busy = self._state
        if command == "home" and self._homing_ticks and not is_homed:
            is_busy, self._homes_at = True, self.ticks + self._homing_ticks
        elif command in ("home", "unhome"):
            is_homed = command == "home"
        state = TRANSITIONS[command].get(state, state)
        self._state = OperatingState(state, is_homed, is_busy)

    def telemetry(self) -> Mapping[str, Floats]:
        return {}

    def wait(self) -> None:
        self.ticks += 1
        self._qd = (self._setpoint - self._q) / self.period
        self._q = self._setpoint.copy()
        if self.ticks == self._homes_at:
            self._state = self._state._replace(is_homed=True, is_busy=False)
        if self.ticks == self._pause_after:
            self.state_command("pause")

    def _require(self, verb: str) -> None:
        if verb not in self.supports:
            raise UnsupportedCommandError(f"{verb}: expected one of {sorted(self.supports)}")
        if self._state.state != "ENABLED" or not self._state.is_homed:
            raise NotReadyError(f"{verb}: the plant is {self._state}")

    def _joint_state(self, q: Floats, qd: Floats) -> JointState:
        n = len(q)
        return JointState(
            time=self.ticks * self.period,
            q=q.copy(),
            qd=qd.copy(),
            tau=np.zeros(n),
            q_motor=np.zeros(0),
            gravity=np.array([0.0, 0.0, -9.81]),
            gravity_age=np.inf,
        )


def ideal_robot(
    q: Sequence[float], name: str = "raven2", kind: type[IdealPlant] = IdealPlant, **options: object
) -> OperatedRobot:
    """A robot of the catalogue without physics, at q."""
    model = load_robot(name)
    joints = {key: getattr(model, key) for key in ("joint_names", "joint_units", "lower", "upper")}
    return OperatedRobot(name, kind(q, **joints, **options), model, lambda: 0)  # type: ignore[arg-type]
