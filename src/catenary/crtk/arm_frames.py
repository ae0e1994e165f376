"""A served arm's state as frames and their numbers: joints, jaws, poses, velocity; written once for each change."""

from catenary.arrays import Floats
from catenary.crtk.frames import Frame, OperatingStateFrames, joint_state_frame, pose_frame, twist_frame
from catenary.crtk.served_arm import ServedArm
from catenary.crtk.tool_numbers import POSES, SIZE, TWIST
from catenary.plant import OperatingState

JAWS = 2  # joints, the last ones
_BASE = "base"
# of an arm's numbers, first those of its joints, (6, n): q, qd, tau as measured, and as set
_ROWS = 6
MEASURED, SETPOINT = 0, 3  # rows
_DISABLED = OperatingState("DISABLED", False, False)


class ArmFrames:
    """What one arm says in every tick. A parked arm's numbers are written once."""

    def __init__(
        self,
        arm: ServedArm,
        first: int = 0,
        *,
        child: str | None = None,
        jaws: str = "jaw",
        columns: tuple[str, ...] = (),
    ) -> None:
        """Prepare.

        Args:
            arm: Whose state.
            first: Where its numbers begin among those of all arms; they end before `end`.
            child: Frame of the tool, where poses are sent as TransformStamped.
            jaws: What the opening of the jaws is called.
            columns: Of its plant's telemetry, each of a number for each joint; of others there are zeros.
        """
        self.arm = arm
        n = len(arm.names)
        self.n = n
        self._first, self._child, self._jaws_name = first, child, jaws
        self.tool = first + _ROWS * n  # see tool_numbers
        own = self.tool + SIZE
        self.columns = {name: own + k * n for k, name in enumerate(columns)}
        self.end = own + n * len(columns)
        self._known = {column.name for column in arm.plant.columns if column.width == n}
        self._states = OperatingStateFrames()
        self._shown = -1  # change that the numbers show

    # what they look like

    def row(self, number: int) -> int:
        """Where a row of the joints' numbers begins."""
        return self._first + number * self.n

    def joints(self, begin: int) -> Frame:
        """Give the frame of its joint states, `MEASURED` or `SETPOINT`."""
        return joint_state_frame(self.arm.names, self.row(begin), self.n)

    def jaws(self, begin: int) -> Frame:
        """Give the frame of the opening of its jaws, jaw1 + jaw2, with the mean of both efforts."""
        content, parts, _ = joint_state_frame((self._jaws_name,), self.row(begin) + self.n - JAWS, self.n)
        factors = 1.0, 1.0, 1.0 / JAWS
        return Frame(
            content,
            tuple(
                part._replace(factor=factor, plus=part.source + 1)
                for part, factor in zip(parts, factors, strict=True)
            ),
        )

    def pose(self, begin: int) -> Frame:
        """Give the frame of where its tool is, in the base. The arm has kinematics."""
        return pose_frame(self.tool + POSES[begin == SETPOINT], _BASE, self._child)

    def twist(self) -> Frame:
        """Give the frame of its tool's velocity as measured, in base axes. The arm has kinematics."""
        return twist_frame(self.tool + TWIST, _BASE)

    def state(self) -> Frame:
        """Give the frame of its operating state, with room for all of them."""
        longest = self._states.frame(_DISABLED)  # no other name is longer
        return Frame(bytes(self.operating_state()), room=len(longest))

    # what they say

    def operating_state(self) -> bytearray:
        """Give its operating state as a frame."""
        return self._states.frame(self.arm.state)

    def keep(self, numbers: Floats) -> None:
        """Take the numbers of all arms, to write its own among them."""
        joints = numbers[self._first : self.tool].reshape(_ROWS, self.n)
        # a view takes as long to make as to fill
        self._joints, self._rows = joints, tuple(joints)
        self._of_tool = numbers[self.tool : self.tool + SIZE]
        self._own = [
            (name, numbers[at : at + self.n]) for name, at in self.columns.items() if name in self._known
        ]

    def write(self) -> None:
        """Write its numbers, if they have changed."""
        arm = self.arm
        if self._shown == arm.changes:
            return
        self._shown = arm.changes
        measured, setpoint = arm.measured, arm.setpoint
        q, qd, tau, q_set, qd_set, tau_set = self._rows
        q[:], qd[:], tau[:] = measured.q, measured.qd, measured.tau
        q_set[:], qd_set[:], tau_set[:] = setpoint.q, setpoint.qd, setpoint.tau
        if arm.tool is not None:
            arm.tool.numbers.write(self._joints, self._of_tool)
        if self._own:
            telemetry = arm.plant.telemetry()
            for name, out in self._own:
                out[:] = telemetry[name]
