"""Recordings of a PSM: its topics by name, and a log on the stamps of its measured_js."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dvrk_psm import PSM as ROBOT
from catenary.dvrk_psm import PSM_JOINTS, PSM_TOPICS, psm_topic, psm_topics
from catenary.errors import InputError
from catenary.recording.extract import extract
from catenary.recording.import_formats.known_layouts import read_psm
from catenary.recording.journal import About
from catenary.recording.recorder import Recorder
from catenary.recording.topic_samples import topic_named
from catenary.verdict.check import findings_of

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
    extraction = extract([tmp_path / "journal"], tmp_path / "extracted")
    assert set(extraction.files) == {f"/{namespace.strip('/')}/{verb}" for verb in PSM_TOPICS}
    found = read_psm([tmp_path / "extracted"], namespace)
    log = found.log
    assert (log.joint_names, log.robot, log.simulated) == (PSM_JOINTS, ROBOT, True)
    assert log.ok.sum() > 0.9 * len(log)
    assert_allclose((log.q_encoder - log.q_nominal)[log.ok], np.tile(OFFSET, (log.ok.sum(), 1)), atol=1e-9)
    assert_allclose(log.qd, np.tile(SPEED, (len(log), 1)))
    assert_allclose(log.tau, 1.0)


def test_a_tracker_that_holds_its_last_pose_is_found_by_the_verdict(tmp_path):
    held = TIME[:, None] * SPEED + OFFSET
    held[1000:3000] = held[1000]
    record(tmp_path / "journal", "/PSM1", ext_jpos=held)
    extract([tmp_path / "journal"], tmp_path / "extracted")
    log = read_psm([tmp_path / "extracted"], "/PSM1").log
    assert "stuck" in [each.name for each in findings_of(log)]


def test_a_recording_without_a_tracker_says_so(tmp_path):
    record(tmp_path / "journal", "/PSM1")
    extract([tmp_path / "journal"], tmp_path / "extracted", topics=["/PSM1/measured_js"])
    with pytest.raises(InputError, match=r"no column .*/PSM1/tracker/measured_js.*; topics are /PSM1/measured_js"):
        read_psm([tmp_path / "extracted"], "/PSM1")


@pytest.mark.parametrize("name", ["/MTML/measured_js", "/PSM1/measured_cp", "/PSM1/jaw/measured_js", "PSM1"])
def test_topics_of_others_are_not_taken_for_a_psms(name):
    assert topic_named(name) is None


def test_a_namespace_that_no_psm_has_is_refused():
    with pytest.raises(InputError, match=r'namespace "/MTML": expected one whose last word begins with PSM'):
        psm_topic("/MTML", "measured_js")
