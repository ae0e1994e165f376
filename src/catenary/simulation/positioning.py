"""The three positioning joints of a simulated RAVEN-II as a robot of their own; its firmware holds the tool."""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.plant import Column, JointState, OperatingState, StateCommand
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.records import POSITIONING


class PositioningArm:
    """A Plant whose joints are those of the robot model of the same name: shoulder, elbow, insertion.

    The robot compensates gravity for these alone, and its model has mass for these alone.
    """

    simulated = True

    def __init__(self, arm: CablePlant) -> None:
        """Take an arm; commands to it and to this one reach the same joints."""
        self.arm = arm
        self.joint_names = arm.joint_names[:POSITIONING]
        self.joint_units = arm.joint_units[:POSITIONING]
        self.period = arm.period
        self.supports = arm.supports
        self.columns: tuple[Column, ...] = arm.columns

    @property
    def lower(self) -> Floats:
        """Software limits below, (3,)."""
        return self.arm.lower[:POSITIONING].copy()

    @property
    def upper(self) -> Floats:
        """Software limits above, (3,)."""
        return self.arm.upper[:POSITIONING].copy()

    @property
    def q_true(self) -> Floats:
        """Where the joints really are, (3,) [rad, rad, m]."""
        return self.arm.state.q.copy()

    @property
    def fault_reason(self) -> str:
        """Why the arm is in FAULT; empty in other states."""
        return self.arm.fault_reason

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

    def operating_state(self) -> OperatingState:
        """Return CRTK's operating state."""
        return self.arm.operating_state()

    def state_command(self, command: StateCommand) -> None:
        """Ask for a transition of the operating state."""
        self.arm.state_command(command)

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column, the tool's numbers included."""
        return self.arm.telemetry()

    def wait(self) -> None:
        """Advance by one tick of 1 ms."""
        self.arm.wait()


def _first(state: JointState) -> JointState:
    n = POSITIONING
    return state._replace(q=state.q[:n], qd=state.qd[:n], tau=state.tau[:n], q_motor=state.q_motor[:n])
