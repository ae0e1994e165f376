"""A plant whose physics a test can do on paper: unit masses, pushed by torque or placed by position."""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.errors import NotReadyError, UnsupportedCommandError
from catenary.plant import Column, JointState, OperatingState, StateCommand

VERBS = frozenset({"measured_js", "setpoint_js", "servo_jp", "servo_jf", "operating_state", "state_command"})


class MassPlant:
    """Obeys the Plant protocol; `log` keeps what it was told. Each joint moves by qdd = tau - friction qd."""

    def __init__(self, q: Floats, *, simulated: bool = True, friction: float = 0.0) -> None:
        n = len(q)
        self.joint_names = tuple(f"j{j}" for j in range(n))
        self.joint_units = ("rad",) * n
        self.lower, self.upper = np.full(n, -3.0), np.full(n, 3.0)
        self.period = 0.001
        self.simulated = simulated
        self.supports = VERBS
        self.columns: tuple[Column, ...] = ()
        self.state = OperatingState("ENABLED", True, False)
        self.q, self.qd, self.tau = np.array(q, dtype=float), np.zeros(n), np.zeros(n)
        self.friction = friction
        self.time = 0.0
        self.log: list[tuple[str, object]] = []

    def measured_js(self) -> JointState:
        gravity = np.array([0.0, 0.0, -9.81])
        return JointState(
            self.time, self.q.copy(), self.qd.copy(), self.tau.copy(), np.zeros(0), gravity, np.inf
        )

    setpoint_js = measured_js

    def servo_jp(self, q: Floats) -> None:
        self._send("servo_jp", q)
        self.q, self.qd, self.tau = np.array(q), np.zeros_like(self.qd), np.zeros_like(self.tau)

    def servo_jr(self, dq: Floats) -> None:
        raise UnsupportedCommandError("servo_jr")

    def servo_jf(self, tau: Floats) -> None:
        self._send("servo_jf", tau)
        self.tau = np.array(tau)

    def operating_state(self) -> OperatingState:
        return self.state

    def state_command(self, command: StateCommand) -> None:
        self.log.append(("state_command", command))
        if command == "pause":
            self.state = OperatingState("PAUSED", self.state.is_homed, False)

    def telemetry(self) -> Mapping[str, Floats]:
        return {}

    def wait(self) -> None:
        self.time += self.period
        self.qd = self.qd + self.period * (self.tau - self.friction * self.qd)
        self.q = self.q + self.period * self.qd

    def _send(self, verb: str, values: Floats) -> None:
        if self.state.state != "ENABLED":
            raise NotReadyError(f"{verb}: {self.state}")
        self.log.append((verb, np.array(values)))
