"""The encoders at the joints as topics: counts, and positions once they are registered."""

from typing import Any, NamedTuple

from catenary.crtk.clock import SECOND
from catenary.crtk.message_values import Stamps, joint_state_message, operating_state
from catenary.crtk.topic_names import JOINT_STATE, topic_name
from catenary.crtk.transport import Transport
from catenary.devices.encoder_board import EncoderBoard, EncoderReading
from catenary.errors import InputError
from catenary.raven2.topics import EXT_JPOS, JOINT_ENC

STATE_TOPIC = topic_name("raven", "operating_state", "gold")
RATE = 200.0  # [Hz] of looks at the board, which sends on its own


class EncoderStatus(NamedTuple):
    """Status of the node."""

    seconds: float  # since it began
    reading: EncoderReading
    robot: str  # its operating state, as last heard; empty when nothing was
    published: dict[str, int]  # messages by topic
    subscribers: int  # programs that listen to either
    is_up: bool  # whether the transport's network answers

    def as_data(self) -> dict[str, Any]:
        """Return plain data: counts, rad and m."""
        data = self._asdict() | self.reading._asdict()
        del data["reading"]
        return data | {"line": data.pop("tally")}


class EncoderNode:
    """Publishes each good row as `joint_enc`, and as `ext_jpos` [rad, rad, m] while it is registered.

    Unknown positions are not published, rather than as zeros. The robot's operating state goes to the board, which
    registers while the robot homes.
    """

    def __init__(self, board: EncoderBoard, transport: Transport, *, state_topic: str = STATE_TOPIC) -> None:
        self.board, self.transport = board, transport
        self.robot = ""
        self._joint_enc = transport.publisher(JOINT_ENC.name, JOINT_STATE)
        self._ext_jpos = transport.publisher(EXT_JPOS.name, JOINT_STATE)
        self._states = transport.subscribe(state_topic, "crtk_msgs/OperatingState")
        self._stamps = Stamps(transport.clock)
        self.published = {JOINT_ENC.name: 0, EXT_JPOS.name: 0}

    def step(self) -> int:
        """Publish the rows that have arrived since the last call; return how many."""
        for message, _ in self._states.take():
            try:
                state = operating_state(message)
            except InputError:
                continue  # a state of another kind of robot says nothing of homing
            self.robot = state.state + " homed" * state.is_homed + " busy" * state.is_busy
            self.board.tell(is_busy=state.is_busy, is_homed=state.is_homed)
        samples = self.board.take()
        # from the board's clock to the transport's
        shift = self.transport.steady() - round(self.board.now() * SECOND)
        names = JOINT_ENC.joint_names
        for sample in samples:
            stamp = self._stamps.next(round(sample.time * SECOND) + shift)
            self._joint_enc.publish(joint_state_message(names, stamp, sample.counts))
            self.published[JOINT_ENC.name] += 1
            if sample.is_valid:
                self._ext_jpos.publish(joint_state_message(names, stamp, sample.q_encoder))
                self.published[EXT_JPOS.name] += 1
        return len(samples)

    def status(self, seconds: float) -> EncoderStatus:
        """Return the status, `seconds` after the begin."""
        connections = self.transport.connections
        listeners = {name for topic in self.published for name in connections(topic).subscribers}
        reading, is_up = self.board.reading(), self.transport.is_up()
        return EncoderStatus(seconds, reading, self.robot, dict(self.published), len(listeners), is_up)
