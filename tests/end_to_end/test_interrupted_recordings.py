"""Recordings over a network that are interrupted: by a kill, a server that stands still, a master that dies."""

import time
from pathlib import Path

import numpy as np
import pytest

from catenary.crtk.message_bytes import codec
from catenary.recording.journal_reader import JournalReader
from meeting import Meeting
from oracles.waves import Waves
from ros import PATIENT_COMMAND, Master, Program

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"])]

MOTION = Waves(12.0, larger=2.0)
EXCITE = """
import sys
from pathlib import Path
from catenary.crtk import client
from catenary.crtk.network import make_transport
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import RosRobot
from catenary.workflows.robot import recorded_passes
from catenary.workflows.robot.homing import AnswerYes
from oracles.waves import Waves

recorded_passes.PASS = 1.0
client.CrtkClient.__init__.__kwdefaults__ |= {"stale_after": 2.0, "connect_timeout": 60.0}
ros, folder = sys.argv[1:]
project = Project(Path(folder), ProjectSettings(connection=f"ros{ros}"))
with make_transport(ros, "catenary_excite") as transport, project:
    robot = RosRobot(transport, AnswerYes(), simulated=True)
    robot.home(project)
    motion = Waves(12.0, larger=2.0)
    robot.record(project, "train", motion, "waves", after="home", progress=lambda done: print(done, flush=True))
print("done", flush=True)
"""


def driven_to(program: Program, share: float) -> bool:
    """Wait until a share of the motion is done; return whether all of it is."""
    while (line := program.line()) != "done":
        if float(line) > share:
            return False
    return True


def test_it_is_finished_with_no_sample_twice_and_none_missing_but_the_told_gaps(
    meeting: Meeting, tmp_path: Path
) -> None:
    network, ros = meeting
    folder = tmp_path / "project"
    with Program(network, PATIENT_COMMAND, "serve", "--ros", ros, "--homed", "--rate", "200") as server:
        server.line()  # it is up
        with Program(network, EXCITE, ros, str(folder)) as program:
            driven_to(program, 0.35)  # killed
        with Program(network, EXCITE, ros, str(folder)) as program:
            driven_to(program, 0.6)
            with server.standing_still():
                _, errors = program.finish()
            assert program.process.returncode == 1
            assert "nothing has come from the robot" in errors
        with Program(network, EXCITE, ros, str(folder)) as program:
            driven_to(program, 0.8)
            if isinstance(network, Master):
                network.kill()
        if isinstance(network, Master):
            network.start()
            time.sleep(3.0)  # the server comes back to it
        with Program(network, EXCITE, ros, str(folder)) as program:
            assert driven_to(program, 2.0)
    holds_the_motion_once(folder / "recordings" / "train")


def holds_the_motion_once(folder: Path) -> None:
    reader = JournalReader(folder)
    decode = codec("sensor_msgs/JointState").decode
    messages = [decode(data) for name, _, data in reader.messages() if name == "/ext_jpos"]
    stamps = 1e-9 * np.array([message.header.stamp for message in messages])
    q = np.array([message.position for message in messages])
    assert (np.diff(stamps) > 0.0).all()  # nothing twice
    assert (reader.lost, reader.damage, reader.ends_early) == (0, [], False)
    told = [remark for remark in reader.problems if "cut off, and went on" in remark]
    seams = np.flatnonzero(np.diff(stamps) > 1.5)
    assert len(told) == len(seams) == 3
    _, rate, _ = MOTION.sample(np.linspace(0.0, MOTION.duration, 2401))
    # a tenth of a second of the motion: messages come late by now and then some ticks of a machine that is busy
    assert (np.abs(np.diff(q, axis=0)) < 0.1 * np.abs(rate).max(axis=0)).all()
