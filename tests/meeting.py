"""Where the programs of a test meet, and how commands of the tests' own process come to take part."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import pytest

from patience import longer_limits
from ros import NODE, Network


class Meeting(NamedTuple):
    """Where programs meet, and the ROS that they are told."""

    network: Network
    ros: str

    def resume(self) -> None:
        """Let a paused robot move on, as its pedal does."""
        from catenary.crtk import network
        from catenary.crtk.client import CrtkClient

        with network.make_transport(self.ros, NODE) as transport, CrtkClient(transport) as robot:
            robot.state_command("resume")


@contextmanager
def taking_part(ros: str) -> Iterator[None]:
    """Let commands of this process meet the others; they wait longer, where the machine is busy and the robot late."""
    from catenary.crtk import network
    from catenary.crtk.ros1.transport import Ros1Transport

    with pytest.MonkeyPatch.context() as patch:
        for longer in longer_limits():
            patch.setattr(*longer)
        if ros == "1":  # of which this process is one node
            patch.setattr(network, "make_transport", lambda ros, name: Ros1Transport(NODE))
        yield
