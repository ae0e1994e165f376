from collections.abc import Iterator

import pytest

from patience import longer_limits
from ros import NODE, Master


@pytest.fixture(scope="module")
def patient_node(ros_master: Master) -> Iterator[None]:
    """Commands of this process take its one node; they wait longer, where the machine is busy and the robot late."""
    from catenary.crtk import network
    from catenary.crtk.ros1.transport import Ros1Transport

    with pytest.MonkeyPatch.context() as patch:
        for longer in longer_limits():
            patch.setattr(*longer)
        patch.setattr(network, "make_transport", lambda ros, name: Ros1Transport(NODE))
        yield
