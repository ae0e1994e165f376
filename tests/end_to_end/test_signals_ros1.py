"""A moving command that is killed, against the served robot over ROS 1: it holds, and is paused.

Ctrl-C: test_tools; every command with every signal: the campaign's part signals.ros1.
"""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from catenary.crtk.client import CrtkClient
from catenary.crtk.ros1.transport import Ros1Transport
from ended_commands import end_over_ros
from meeting import taking_part
from ros import NODE, PATIENT_COMMAND, Master, Program

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served(ros_master: Master) -> Iterator[CrtkClient]:
    """A homed robot, and a program that looks at it."""
    with taking_part("1"), Program(ros_master, PATIENT_COMMAND, "serve", "--rate", "50", "--homed") as server:
        server.line()  # it is up
        with Ros1Transport(NODE) as transport, CrtkClient(transport) as one:
            yield one


def test_a_command_that_is_killed_leaves_the_robot_holding_and_paused(
    ros_master: Master, served: CrtkClient, tmp_path: Path
) -> None:
    end_over_ros(ros_master, served, tmp_path, "follow", signal.SIGKILL)
