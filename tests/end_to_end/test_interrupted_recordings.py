"""Recordings over a network that are interrupted: by a kill, a server that stands still, a master that dies."""

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree

from catenary.crtk.message import codec
from catenary.raven2.topics import state_column
from catenary.recording.bag_reader import JournalReader
from meeting import Meeting
from network_namespaces import ENTER, cable
from oracles.waves import Advancing, Waves
from patience import until
from ros import PATIENT_COMMAND, Master, Program

pytestmark = pytest.mark.slow

MOTION = Waves(12.0, larger=2.0)
TRIAL = Advancing(60.0 * float(os.environ.get("CATENARY_TRIAL_MINUTES", "0.5")))  # 20 are tried by hand
EXCITE = """
import sys
from pathlib import Path
from catenary.crtk import client
from catenary.crtk.network import make_transport
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import RosRobot
from catenary.workflows.robot.homing import AnswerYes
from oracles.waves import Advancing, Waves

client.CrtkClient.__init__.__kwdefaults__ |= {"stale_after": 2.0, "connect_timeout": 60.0}
ros, folder, motion = sys.argv[1:]
project = Project(Path(folder), ProjectSettings(connection=f"ros{ros}"))
with make_transport(ros, "catenary_excite") as transport, project:
    robot = RosRobot(transport, AnswerYes(), simulated=True)
    robot.home(project)
    robot.record(project, "train", eval(motion), "waves", after="home", progress=lambda done: print(done, flush=True))
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
        with Program(network, EXCITE, ros, str(folder), "Waves(12.0, larger=2.0)") as program:
            driven_to(program, 0.35)  # killed
        with Program(network, EXCITE, ros, str(folder), "Waves(12.0, larger=2.0)") as program:
            driven_to(program, 0.6)
            with server.standing_still():
                _, errors = program.finish()
            assert program.process.returncode == 1
            assert "nothing has come from the robot" in errors
        with Program(network, EXCITE, ros, str(folder), "Waves(12.0, larger=2.0)") as program:
            driven_to(program, 0.8)
            if isinstance(network, Master):
                network.kill()
        if isinstance(network, Master):
            network.start()
        with Program(network, EXCITE, ros, str(folder), "Waves(12.0, larger=2.0)") as program:
            assert driven_to(program, 2.0)
    holds_the_motion_once(folder / "recordings" / "train")
    assert not (folder / "replaced").exists()


def read(folder: Path) -> tuple[JournalReader, np.ndarray, np.ndarray]:
    """Return a recording, its stamps (N,) [s] and setpoints (N, 3)."""
    reader = JournalReader(folder)
    decode = codec("raven_2/raven_state").decode
    messages = [decode(data) for name, _, data in reader.messages() if name == "/ravenstate"]
    stamps = 1e-9 * np.array([message.hdr.stamp for message in messages])
    return reader, stamps, np.array([state_column(message, "jpos_d") for message in messages])[:, : len(MOTION.start)]


def holds_the_motion_once(folder: Path) -> None:
    """By its setpoints: where the joints then are differs from them by what cables and gears do."""
    reader, stamps, setpoints = read(folder)
    assert (np.diff(stamps) > 0.0).all()  # nothing twice
    assert (reader.lost, reader.ends_early) == (0, False)
    assert all("lacks its index, or part of it: it was cut off" in torn for torn in reader.damage)  # by kills
    told = [remark for remark in reader.problems if " ended it, " in remark]
    assert sum("a stalled robot, ended it" in remark for remark in told) >= 1
    assert sum("cut off, and went on" in remark for remark in reader.problems) == 3
    apart = np.diff(stamps)
    assert 3 <= np.sum(apart > 1.5) <= len(reader.problems)  # each is told, also where the machine alone is to blame
    instants = np.arange(0.0, MOTION.duration + 5e-4, 1e-3)
    away, nearest = KDTree(MOTION.sample(instants)[0] / MOTION.size).query(setpoints / MOTION.size)
    # the motion's own path, which never comes by where it was; where a machine that is busy skips ticks, a chord of it
    assert np.quantile(away, 0.9) < 1e-3
    assert away.max() < 0.05
    places = instants[nearest]
    assert max(places[0], MOTION.duration - places[-1]) < 0.15
    assert -0.02 < np.diff(places).min()
    # messages come 30 times a second, or more rarely on a machine that is busy: then it does four commands a tick
    most = 0.15 + np.where(apart < 1.5, 4.0 * apart, 0.0)
    assert (np.diff(places) < most).all()


@pytest.mark.timeout(600.0 + 3.0 * TRIAL.duration)
def test_a_trial_with_kills_a_restart_and_a_cut_cable_is_one_recording_of_each_second_once(tmp_path: Path) -> None:
    folder, motion = str(tmp_path / "project"), f"Advancing({TRIAL.duration})"
    served = (ENTER + PATIENT_COMMAND, "serve", "--ros", "2", "--homed", "--rate", "200")
    with cable() as (robot, client):

        @contextmanager
        def driven(share: float) -> Iterator[Program]:
            """Yield the client when so much is done; one that a busy machine has kept waiting too long begins again."""
            while True:
                with Program(client, ENTER + EXCITE, "2", folder, motion) as program:
                    try:
                        driven_to(program, share)
                    except AssertionError as error:
                        if "nothing has come from the robot" not in str(error):
                            raise
                    else:
                        yield program
                        return

        def ends(program: Program) -> None:
            _, errors = program.finish()
            assert program.process.returncode == 1
            assert "nothing has come from the robot" in errors

        with Program(robot, *served) as server:
            server.line()  # it is up
            with driven(0.2):
                pass  # killed
            with driven(0.4) as program, server.standing_still():
                ends(program)
            with driven(0.6) as program:
                server.process.kill()
                ends(program)
        with Program(robot, *served) as server:
            server.line()
            with driven(0.8) as program:
                client.set("down")
                ends(program)
            client.set("up")
            with driven(2.0):
                pass
    reader, stamps, setpoints = read(tmp_path / "project" / "recordings" / "train")
    assert (np.diff(stamps) > 0.0).all()
    assert (reader.lost, reader.ends_early) == (0, False)
    assert sum("cut off, and went on" in remark for remark in reader.problems) >= 4
    places = TRIAL.instants(setpoints)  # by its one joint that never comes by where it was
    assert np.abs((setpoints - TRIAL.sample(places)[0]) / TRIAL.size)[:, :2].max() < 0.05
    assert set(range(round(TRIAL.duration))) <= set(np.floor(places).astype(int))
    assert -0.02 < np.diff(places).min()
    assert (np.diff(places) < 0.15 + np.where(np.diff(stamps) < 1.5, 4.0 * np.diff(stamps), 0.0)).all()


def test_what_others_do_is_recorded_on_after_a_kill_and_a_silence_is_told(meeting: Meeting, tmp_path: Path) -> None:
    network, ros = meeting
    folder = tmp_path / "project" / "recordings" / "test"
    record = ("record", str(tmp_path / "project"), "--ros", ros, "--no-motion", "--hours", "0.003", "--simulated")

    def kept() -> int:
        return sum(path.stat().st_size for path in folder.glob("*.mcap"))

    with Program(network, PATIENT_COMMAND, "serve", "--ros", ros, "--homed", "--rate", "200") as server:
        server.line()  # it is up
        with Program(network, PATIENT_COMMAND, *record):
            until(lambda: kept() > 300_000)  # killed
        before = kept()
        with Program(network, PATIENT_COMMAND, *record, "--json") as program:
            until(lambda: kept() > before + 100_000)
            with server.standing_still():
                time.sleep(2.0)
            out, errors = program.finish()
    assert program.process.returncode == 0, errors
    assert json.loads(out)["seconds"] == pytest.approx(10.8, abs=2.0)  # a machine that is busy ends it late
    reader = JournalReader(folder)
    decode = codec("sensor_msgs/JointState").decode
    stamps = [decode(data).header.stamp for name, _, data in reader.messages() if name == "/ext_jpos"]
    assert (np.diff(stamps) > 0).all()
    assert (reader.lost, reader.ends_early) == (0, False)
    (torn,) = reader.damage
    assert "0000.mcap: lacks its index, or part of it: it was cut off" in torn  # by the kill
    told = [remark for remark in reader.problems if "cut off, and went on" in remark or "no message for" in remark]
    assert sum("cut off, and went on" in remark for remark in told) == 1
    assert sum("/ext_jpos: no message for" in remark for remark in told) >= 1
    assert 2 <= np.sum(1e-9 * np.diff(stamps) > 1.5) <= len(told)  # each is told
