"""What a dialect says in every tick, to whoever listens: many topics, written and sent together."""

from collections.abc import Sequence
from typing import NamedTuple

from catenary.crtk.arm_frames import ArmFrames
from catenary.crtk.frames import Frame
from catenary.crtk.outlet import Outlet
from catenary.crtk.sheet import Sheet
from catenary.crtk.transport import Transport


class Spoken(NamedTuple):
    """A topic and what is said on it."""

    outlet: Outlet
    frame: Frame
    state_of: ArmFrames | None = None  # whose operating state it is, where it is one


class Broadcast:
    """Topics that are sent in every tick, in their order; nothing is made while nobody listens."""

    def __init__(
        self, transport: Transport, spoken: Sequence[Spoken], arms: Sequence[ArmFrames], size: int
    ) -> None:
        """Begin; from now on nothing else publishes on the topics.

        Args:
            transport: What carries them.
            spoken: The topics.
            arms: Whose numbers are in them.
            size: How many numbers there are.
        """
        self.sheet = Sheet([one.frame for one in spoken], size)
        self.numbers = self.sheet.numbers
        self._bundle = transport.bundle([one.outlet.publisher for one in spoken], self.sheet)
        self._outlets = [one.outlet for one in spoken]
        self._heard = [False] * len(spoken)
        self._arms = arms
        # operating states have no numbers: their frames are replaced
        self._states = [(k, one.state_of) for k, one in enumerate(spoken) if one.state_of is not None]
        self._told: list[bytearray | None] = [None] * len(self._states)
        for arm in arms:
            arm.keep(self.numbers)
        self._write(0)  # what is compiled on first use is compiled here, not when the first client comes
        self._bundle.send()

    def send(self, stamp: int) -> None:
        """Write and send, stamped [ns]."""
        heard = [outlet.heard for outlet in self._outlets]
        if heard != self._heard:
            self._heard = heard
            self.sheet.heard[:] = heard
        if True not in heard:
            return
        self._write(stamp)
        self._bundle.send()

    def _write(self, stamp: int) -> None:
        for arm in self._arms:
            arm.write()
        for i, (topic, arm) in enumerate(self._states):
            state = arm.operating_state()
            if state is not self._told[i]:
                self.sheet.replace(topic, state)
                self._told[i] = state
        self.sheet.write(stamp)
