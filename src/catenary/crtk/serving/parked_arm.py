"""An arm that stands parked: it reports where it is and obeys nothing."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import UnsupportedCommandError
from catenary.plant import Column, JointState, OperatingState, StateCommand
from catenary.spatial import LEVEL


class ParkedArm:
    """A `Plant` that is DISABLED for good, in the place of an arm that a robot has but nobody uses."""

    simulated = True
    supports: frozenset[str] = frozenset()
    columns: tuple[Column, ...] = ()

    def __init__(
        self,
        joint_names: tuple[str, ...],
        joint_units: tuple[str, ...],
        q: ArrayLike,
        *,
        period: float = 1e-3,
    ) -> None:
        """Park an arm at joints q (n,) [rad|m]."""
        self.joint_names, self.joint_units, self.period = joint_names, joint_units, period
        n = len(joint_names)
        place = as_array("q", q, (n,))
        self.lower, self.upper = place.copy(), place.copy()
        rest = np.zeros(n)
        self._state = JointState(0.0, place, rest, rest, np.zeros(0), LEVEL.copy(), np.inf)

    def measured_js(self) -> JointState:
        """Where it stands."""
        state = self._state
        return state._replace(q=state.q.copy(), qd=state.qd.copy(), tau=state.tau.copy())

    def setpoint_js(self) -> JointState:
        """Where it stands."""
        return self.measured_js()

    def operating_state(self) -> OperatingState:
        """Disabled."""
        return OperatingState("DISABLED", False, False)

    def telemetry(self) -> Mapping[str, Floats]:
        """Nothing."""
        return {}

    def wait(self) -> None:
        """Stand."""

    def state_command(self, command: StateCommand) -> None:
        """Refuse."""
        raise UnsupportedCommandError(f'state command "{command}": the arm is parked')

    def servo_jp(self, q: Floats) -> None:
        """Refuse."""
        raise UnsupportedCommandError("servo_jp: the arm is parked")

    def servo_jr(self, dq: Floats) -> None:
        """Refuse."""
        raise UnsupportedCommandError("servo_jr: the arm is parked")

    def servo_jf(self, tau: Floats) -> None:
        """Refuse."""
        raise UnsupportedCommandError("servo_jf: the arm is parked")
