"""What a RAVEN-II publishes beside its joint states, received: `raven_state` in SI, and the external encoders."""

from collections.abc import Mapping

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.message import Message
from catenary.crtk.transport import Latest, Transport
from catenary.plant import Column, OperatingState
from catenary.raven2.topics import (
    CHANNELS,
    EXT_JPOS,
    JOINT_ENC,
    RAVENSTATE,
    RAVENSTATE_100HZ,
    RUN_LEVELS,
    STATE_COLUMNS,
    Arm,
    state_column,
)
from catenary.topics import TopicColumn


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
        state = RUN_LEVELS.get(int(message.runlevel), RUN_LEVELS[0])
        # the robot's sublevel says whether all joints are homed [raven2, branch crtk: publish_ravenstate_ros]
        is_homed = state.is_homed or (state.state == "DISABLED" and message.sublevel == 1)
        return state._replace(is_homed=is_homed)

    def arm_values(self, name: str) -> Floats:
        """Return the arm's seven numbers in a field of 16 channels."""
        return state_column(self.message(), name).take(CHANNELS[self._arm])

    def sample(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column, in arrays of the receiver's own."""
        message = self.message()
        state = {name: state_column(message, name) for name in STATE_COLUMNS}
        return state | {name: self.encoder(name) for name in self._declared}

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
