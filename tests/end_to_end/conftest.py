from collections.abc import Iterator

import pytest

from dds import Network as Domain
from meeting import Meeting, taking_part


@pytest.fixture(scope="module", params=["1", "2"], ids=["ros1", "dds"])
def meeting(request: pytest.FixtureRequest) -> Iterator[Meeting]:
    """Over ROS 1, then over DDS; this process takes part."""
    if request.param == "1":
        network = request.getfixturevalue("ros_master")
    else:
        network = Domain(request.getfixturevalue("dds_domain"))
    with taking_part(request.param):
        yield Meeting(network, request.param)
