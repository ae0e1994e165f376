"""Recordings of a PSM: its topics by name, and a log on the stamps of its measured_js."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dvrk_psm import PSM as ROBOT
from catenary.dvrk_psm import PSM_JOINTS, psm_topics
from catenary.errors import InputError
from catenary.recording.import_formats.known_layouts import read_psm
from catenary.recording.journal import About
from catenary.recording.layout import topic_named
from catenary.recording.recorder import Recorder
from catenary.workflows.import_recording import import_recording, propose_mapping
from lab_bags import JOINT_STATE, joint_state, write_bag

TIME = np.arange(4000) * 1e-3
SPEED = np.array([0.1, -0.1, 0.02, 0.5, -0.4, 0.3])
OFFSET = np.array([0.01, -0.01, 1e-3, 0.1, 0.2, -0.1])


def record(folder, namespace, **changed):
    q = TIME[:, None] * SPEED
    telemetry = {
        "measured_js": q,
        "measured_js_velocity": np.tile(SPEED, (len(TIME), 1)),
        "measured_js_effort": np.ones_like(q),
        "setpoint_js": q,
        "ext_jpos": q + OFFSET,
        **changed,
    }
    topics, rng = psm_topics(namespace), np.random.default_rng(0)
    with Recorder(folder, topics, telemetry, rng, about=About(robot=ROBOT, simulated=True)) as recorder:
        recorder.observe_many(TIME, telemetry)


@pytest.mark.parametrize("namespace", ["/PSM1", "PSM2", "/cart/PSM3"])
def test_the_tracker_is_brought_onto_the_robots_stamps(tmp_path, namespace):
    record(tmp_path / "journal", namespace)
    found = read_psm([tmp_path / "journal"], namespace)
    log = found.log
    assert (log.joint_names, log.robot, log.simulated) == (PSM_JOINTS, ROBOT, True)
    assert log.ok.sum() > 0.9 * len(log)
    assert_allclose((log.q_encoder - log.q_nominal)[log.ok], np.tile(OFFSET, (log.ok.sum(), 1)), atol=1e-9)
    assert_allclose(log.qd, np.tile(SPEED, (len(log), 1)))
    assert_allclose(log.tau, 1.0)


def test_a_recording_without_a_tracker_says_so(tmp_path):
    bag = write_bag(
        tmp_path / "psm",
        "ros1",
        {"/PSM1/measured_js": JOINT_STATE},
        [(0.0, "/PSM1/measured_js", joint_state(PSM_JOINTS, np.zeros(6)))],
    )
    with pytest.raises(InputError, match=r"no column .*/PSM1/tracker/measured_js.*; topics are /PSM1/measured_js"):
        read_psm([bag], "/PSM1")


@pytest.mark.parametrize("name", ["/MTML/measured_js", "/PSM1/measured_cp", "/PSM1/jaw/measured_js", "PSM1"])
def test_topics_of_others_are_not_taken_for_a_psms(name):
    assert topic_named(name) is None


SHORT = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")  # of the dVRK's present versions


@pytest.mark.parametrize("count", [3, 6])  # without an instrument, and with one
@pytest.mark.parametrize("names", [PSM_JOINTS, SHORT])
def test_potentiometers_are_offered_as_what_measured_the_joints(tmp_path, count, names):
    time = np.arange(600) * 1e-2
    q = (0.2 * np.sin(np.outer(time, 1.0 + 0.3 * np.arange(6))) + [0, 0, 0.12, 0, 0, 0])[:, :count]
    topics = ("/PSM1/measured_js", "/PSM1/setpoint_js", "/PSM1/io/pot/measured_js")
    messages = [
        (t, topic, joint_state(names[:count], row + 0.02 * ("pot" in topic)))
        for topic in topics
        for t, row in zip(time, q, strict=True)
    ]
    bag = write_bag(tmp_path / "psm", "ros1", dict.fromkeys(topics, JOINT_STATE), messages)
    proposal = propose_mapping(bag, robot=ROBOT)
    assert [question.partition(" are q_encoder")[0] for question in proposal.questions] == [
        "whether the potentiometers /PSM1/io/pot/measured_js.position"
    ]
    assert (
        "mm" not in proposal.toml.partition("[q_nominal]")[2]
    )  # -80 mm is beyond the limit: no reason to read microns
    log = import_recording(bag, [f"q_nominal={topics[0]}.position", f"q_encoder={topics[2]}.position"], robot=ROBOT)
    assert log.joint_names == PSM_JOINTS[:count]
    assert log.joint_units == ("rad", "rad", "m", "rad", "rad", "rad")[:count]
    assert_allclose(log.q_encoder - log.q_nominal, 0.02, atol=1e-9)
