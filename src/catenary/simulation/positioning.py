"""The three positioning joints of a simulated RAVEN-II as a robot of their own; its firmware holds the tool."""

from typing import Any

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.plant import JointState
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.records import POSITIONING


class PositioningArm:
    """A Plant whose joints are those of the robot model of the same name: shoulder, elbow, insertion.

    The robot compensates gravity for these alone, and its model has mass for these alone. What is not of joints, such
    as the operating state, telemetry and the clock, is the arm's own.
    """

    def __init__(self, arm: CablePlant) -> None:
        """Take an arm; commands to it and to this one reach the same joints."""
        self.arm = arm
        self.joint_names = arm.joint_names[:POSITIONING]
        self.joint_units = arm.joint_units[:POSITIONING]
        self.lower, self.upper = arm.lower[:POSITIONING], arm.upper[:POSITIONING]  # software limits

    def __getattr__(self, name: str) -> Any:
        if name == "arm":  # while a copy is made
            raise AttributeError(name)
        return getattr(self.arm, name)

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
