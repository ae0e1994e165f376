"""Plants without physics, or with one that a test can do on paper."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.errors import InputError, NotReadyError, UnsupportedCommandError
from catenary.plant import TRANSITIONS, Column, JointState, OperatingState, StateCommand
from catenary.robots.catalog import load_robot
from catenary.workflows.robot.operated_robot import OperatedRobot

Floats = NDArray[np.float64]


class IdealPlant:
    """Obeys the Plant protocol: it is where its setpoint says, one tick later.

    `setpoints` keeps what it was sent, `pause_after` ticks it pauses by itself.
    """

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
        self.q, self.qd, self.tau = np.array(q, dtype=float), np.zeros(n), np.zeros(n)
        self._setpoint = self.q.copy()
        self.state = OperatingState("ENABLED" if ready else "DISABLED", ready, False)

    @property
    def time(self) -> float:
        return self.ticks * self.period

    def measured_js(self) -> JointState:
        gravity = np.array([0.0, 0.0, -9.81])
        q, qd, tau = self.q.copy(), self.qd.copy(), self.tau.copy()
        return JointState(self.time, q, qd, tau, np.zeros(0), gravity, np.inf)

    def setpoint_js(self) -> JointState:
        return self.measured_js()._replace(q=self._setpoint.copy(), qd=np.zeros_like(self.q))

    def servo_jp(self, q: Floats) -> None:
        self._require("servo_jp")
        if q.shape != self.q.shape:
            raise InputError(f"q: expected shape {self.q.shape}, got {q.shape}")
        self._setpoint = np.array(q)
        self.setpoints.append(self._setpoint.copy())

    def servo_jr(self, dq: Floats) -> None:
        self._require("servo_jr")
        self._setpoint = self._setpoint + dq
        self.setpoints.append(self._setpoint.copy())

    def servo_jf(self, tau: Floats) -> None:
        raise UnsupportedCommandError(f"servo_jf: expected one of {sorted(self.supports)}")

    def operating_state(self) -> OperatingState:
        return self.state

    def state_command(self, command: StateCommand) -> None:
        state, is_homed, is_busy = self.state
        if command == "home" and self._homing_ticks and not is_homed:
            is_busy, self._homes_at = True, self.ticks + self._homing_ticks
        elif command in ("home", "unhome"):
            is_homed = command == "home"
        state = TRANSITIONS[command].get(state, state)
        self.state = OperatingState(state, is_homed, is_busy)

    def telemetry(self) -> Mapping[str, Floats]:
        return {}

    def wait(self) -> None:
        self._move()
        self.ticks += 1
        if self.ticks == self._homes_at:
            self.state = self.state._replace(is_homed=True, is_busy=False)
        if self.ticks == self._pause_after:
            self.state_command("pause")

    def _move(self) -> None:
        self.qd = (self._setpoint - self.q) / self.period
        self.q = self._setpoint.copy()

    def _require(self, verb: str) -> None:
        if verb not in self.supports:
            raise UnsupportedCommandError(f"{verb}: expected one of {sorted(self.supports)}")
        if self.state.state != "ENABLED" or not self.state.is_homed:
            raise NotReadyError(f"{verb}: the plant is {self.state}")


class MassPlant(IdealPlant):
    """Unit masses, pushed by torque, qdd = tau - friction qd, or placed by position; `log` keeps what it was told."""

    def __init__(self, q: Floats, *, simulated: bool = True, friction: float = 0.0) -> None:
        super().__init__(
            q,
            joint_names=[f"j{j}" for j in range(len(q))],
            supports=frozenset({"measured_js", "setpoint_js", "servo_jp", "servo_jf", "state_command"}),
        )
        self.simulated, self.friction = simulated, friction
        self.log: list[tuple[str, object]] = []

    def setpoint_js(self) -> JointState:
        return self.measured_js()

    def servo_jp(self, q: Floats) -> None:
        self._require("servo_jp")
        self.log.append(("servo_jp", np.array(q)))
        self.q, self.qd, self.tau = np.array(q), np.zeros_like(self.qd), np.zeros_like(self.tau)

    def servo_jf(self, tau: Floats) -> None:
        self._require("servo_jf")
        self.log.append(("servo_jf", np.array(tau)))
        self.tau = np.array(tau)

    def state_command(self, command: StateCommand) -> None:
        self.log.append(("state_command", command))
        super().state_command(command)

    def _load(self) -> Floats:
        """What else pulls at the joints."""
        return np.zeros_like(self.q)

    def _move(self) -> None:
        self.qd = self.qd + self.period * (self.tau - self._load() - self.friction * self.qd)
        self.q = self.q + self.period * self.qd


def ideal_robot(
    q: Sequence[float], name: str = "raven2", kind: type[IdealPlant] = IdealPlant, **options: object
) -> OperatedRobot:
    """A robot of the catalogue without physics, at q."""
    model = load_robot(name)
    joints = {key: getattr(model, key) for key in ("joint_names", "joint_units", "lower", "upper")}
    return OperatedRobot(name, kind(q, **{**joints, **options}), model, lambda: 0)  # type: ignore[arg-type]
