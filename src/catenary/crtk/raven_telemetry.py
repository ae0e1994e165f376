"""What a RAVEN-II publishes beside its joint states: `raven_state` in SI, external encoders.

The traps of raven_state, by the one table of `recording.topics`: every position and velocity is multiplied by 180/pi,
metres of insertion too; `pos` is in whole micrometres; `tau` is what was commanded. Arms come as 8 channels each, gold
first.
"""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message
from catenary.crtk.transport import Latest, Transport
from catenary.errors import InputError
from catenary.plant import Column, OperatingState
from catenary.recording.raven_transmission import CALIBRATED, COUPLING, JOINT_TORQUE
from catenary.recording.topics import EXT_JPOS, JOINT_ENC, JOINTS, RAVENSTATE, RAVENSTATE_100HZ, Arm, TopicColumn
from catenary.transmission.cable_coupling import joint_forces

_COLUMNS = {column.name: column for column in RAVENSTATE.columns}
# channels of measured_js's joints: shoulder, elbow, insertion, roll, wrist, two jaws
CHANNELS: Mapping[str, tuple[int, ...]] = {"gold": (0, 1, 2, 4, 5, 6, 7), "green": (8, 9, 10, 12, 13, 14, 15)}


def raven_state_columns(message: Message) -> dict[str, Floats]:
    """Return raven_state's fields in SI, each (width,)."""
    return {name: raven_state_column(message, name) for name in _COLUMNS}


def raven_state_column(message: Message, name: str) -> Floats:
    """Return one of raven_state's fields in SI, (width,)."""
    values = np.atleast_1d(np.asarray(getattr(message, name), dtype=np.float64))
    return values / SECOND if name == "dt" else values * _COLUMNS[name].to_si


def arm_channels(values: Floats, arm: Arm) -> Floats:
    """Return the seven joints of one arm, in the order of measured_js, out of 16 channels."""
    if arm not in CHANNELS:
        raise InputError(f'arm "{arm}": expected {" or ".join(CHANNELS)}')
    return as_array("channels", values, (16,), finite=False).take(CHANNELS[arm])


# state that a run level stands for: emergency stop, init, pedal up, pedal down
_RUN_LEVELS = {
    0: OperatingState("DISABLED", False, False),
    1: OperatingState("ENABLED", False, True),
    2: OperatingState("PAUSED", True, False),
    3: OperatingState("ENABLED", True, False),
}
_TORQUE_RATIO = np.array([JOINT_TORQUE[name] for name in JOINTS])


def joint_torques(tau: Floats) -> Floats:
    """Return joint torques (7,) [Nm, Nm, N, Nm...], as in a motion log, from those at the gearboxes' outputs."""
    torques: Floats = tau * _TORQUE_RATIO
    torques[: len(CALIBRATED)] = joint_forces(COUPLING, (torques[0], torques[1], torques[2]))
    return torques


class RavenTelemetry:
    """Latest raven_state and encoder readings as named columns in SI, both arms' channels."""

    def __init__(self, transport: Transport, arm: Arm, stale_after: float) -> None:
        """Begin to receive; encoders that nobody publishes now are left out of the columns."""
        self.latest = Latest(transport, RAVENSTATE.name, RAVENSTATE.type)
        self._throttled = Latest(transport, RAVENSTATE_100HZ.name, RAVENSTATE_100HZ.type)  # as in recordings
        self._arm: Arm = arm
        self._stale_after = stale_after
        self._encoders = {
            topic.columns[0].name: Latest(transport, topic.name, topic.type) for topic in (EXT_JPOS, JOINT_ENC)
        }
        there = transport.topics()
        encoders = [topic.columns[0] for topic in (EXT_JPOS, JOINT_ENC) if topic.name in there]
        self._declared = tuple(column.name for column in encoders)
        self.columns = tuple(Column(c.name, _unit(c), c.width) for c in (*RAVENSTATE.columns, *encoders))

    def message(self) -> Message:
        """Return the newest raven_state, None before the first; a recording holds the throttled ones."""
        message = self.latest.message()
        return self._throttled.message() if message is None else message

    @property
    def topic(self) -> str:
        """Topic that raven_state has come on."""
        return (self._throttled if self.latest.message() is None else self.latest).topic

    def age(self) -> float:
        """Return the seconds since the newest raven_state came in."""
        return min(self.latest.age(), self._throttled.age())

    def operating_state(self) -> OperatingState:
        """Return the operating state that the run level stands for; one in FAULT reads DISABLED."""
        message = self.message()
        state = _RUN_LEVELS.get(int(message.runlevel), _RUN_LEVELS[0])
        # the robot's sublevel says whether all joints are homed [raven2, branch crtk: publish_ravenstate_ros]
        is_homed = state.is_homed or (state.state == "DISABLED" and message.sublevel == 1)
        return state._replace(is_homed=is_homed)

    def arm_values(self, name: str) -> Floats:
        """Return the arm's seven numbers in a field of 16 channels."""
        return arm_channels(raven_state_column(self.message(), name), self._arm)

    def sample(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column, in arrays of the receiver's own."""
        return raven_state_columns(self.message()) | {name: self.encoder(name) for name in self._declared}

    def encoder(self, name: str) -> Floats:
        """Return the latest reading of an encoder column (3,); NaN where nothing has come for too long."""
        encoder = self._encoders[name]
        if encoder.age() > self._stale_after:
            return np.full(3, np.nan)
        return np.array(encoder.message().position[:3], dtype=float)

    def close(self) -> None:
        """Receive no more."""
        for latest in (self.latest, self._throttled, *self._encoders.values()):
            latest.close()


def _unit(column: TopicColumn) -> str:
    """Return the units of a column's numbers, in their order; 1 where none is stated."""
    return "|".join(dict.fromkeys(unit for unit in column.units if unit)) or "1"
