"""`/diagnostics` of a served robot: each arm's state, and why it is in FAULT, for whoever watches robots in ROS's way.

Once a second, and at once when a state changes. [diagnostic_msgs/DiagnosticArray; ROS REP 107: name, hardware_id]
"""

from collections.abc import Mapping

from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.names import DIAGNOSTICS, DIAGNOSTICS_TYPE
from catenary.crtk.serving.reports import Reports
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.transport import Transport
from catenary.plant import OperatingState, fault_of

_Array, _Status, _KeyValue = (
    message_class(f"diagnostic_msgs/{name}") for name in ("DiagnosticArray", "DiagnosticStatus", "KeyValue")
)
OK, WARN, ERROR = 0, 1, 2  # levels


class Diagnostics:
    """Publishes a status for each arm that moves."""

    def __init__(self, transport: Transport, arms: Mapping[str, ServedArm], reports: Reports) -> None:
        """Begin to publish."""
        self._publisher = transport.publisher(DIAGNOSTICS, DIAGNOSTICS_TYPE, latch=True)
        self._arms = {name: arm for name, arm in arms.items() if arm.machine.can_change}
        self._reports = reports
        self._told: dict[str, OperatingState] = {}
        self._at: int | None = None  # [ns]

    def publish(self, now: int, stamp: int) -> None:
        """Publish at `now` [ns], stamped so [ns], if it is time or something has changed; say why a new fault came."""
        states = {name: arm.state for name, arm in self._arms.items()}
        if states == self._told and self._at is not None and 0 <= now - self._at < SECOND:
            return
        for name, arm in self._arms.items():
            if states[name].state == "FAULT" and (
                name not in self._told or self._told[name].state != "FAULT"
            ):
                why = fault_of(arm.plant) or "the robot does not say why"
                self._reports.say(f"{name}: FAULT", why, now, to=(name,), each=True)
        self._told, self._at = states, now
        self._publisher.publish(
            _Array(header(stamp), tuple(self._status(name, arm) for name, arm in self._arms.items()))
        )

    def _status(self, name: str, arm: ServedArm) -> Message:
        state = arm.state
        refused = sum(one.count for kind, one in self._reports.kinds.items() if kind.endswith(": refused"))
        level, text = (
            (OK, state.state) if state.is_homed or state.is_busy else (WARN, f"{state.state}, not homed")
        )
        if state.state == "FAULT":
            level, text = ERROR, f"FAULT: {fault_of(arm.plant) or 'no reason is known'}"
        values = {
            "state": state.state,
            "is_homed": str(state.is_homed),
            "is_busy": str(state.is_busy),
            "commands refused": str(refused),
        }
        pairs = tuple(_KeyValue(key, value) for key, value in values.items())
        return _Status(level, f"catenary: {name} arm", text, arm.place, pairs)
