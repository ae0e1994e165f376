"""A project on a simulated PSM: homed, recorded, calibrated, deployed; and what such a project refuses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import CablePlant, MotionLog, record_simulated
from catenary.calibration.fit_options import FitOptions
from catenary.dvrk_psm import PSM_JOINTS
from catenary.errors import InputError
from catenary.recording.logs import read_log
from catenary.simulation.firmware_plant import restore_plant, save_plant
from catenary.simulation.psm_plant import PsmPlant
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER
from catenary.verdict.delay import delay_of
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import motion_log_path
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.kinds import project_kind
from oracles.psm_arms import homed_psm


def width_of(log: MotionLog) -> np.ndarray:
    """Return how wide the intervals of joints' own delays are [s]."""
    return np.array([high - low for _, low, high in delay_of(log).alone])


def homed_raven() -> CablePlant:
    plant = CablePlant(seed=3, start=(0.5, 1.5, 0.40), substeps=1)
    plant.home()
    return plant


SHORT = ProjectSettings(robot="dvrk_psm", seed=1, train_minutes=1.0, test_minutes=0.25)
QUICK_MODELS = {calibrate.RECOMMENDED: FitOptions(kind="linear")}


@pytest.mark.slow
def test_a_psm_is_calibrated_from_homing_to_a_report(tmp_path, monkeypatch):
    monkeypatch.setattr(calibrate, "models_for", lambda *_: QUICK_MODELS)
    monkeypatch.setattr(calibrate, "_DEPLOY_S", 2.0)
    project = Project(tmp_path / "psm", SHORT)
    done = calibrate.calibrate_robot(project)
    assert done.page.is_file()
    log = read_log(motion_log_path(project, "train"))
    assert log.joint_names == PSM_JOINTS
    assert log.simulated
    found = done.evaluations[calibrate.RECOMMENDED].joints
    assert all(joint.rmse < joint.raw_rmse for joint in found)
    assert [joint["name"] for joint in done.deployment["joints"]] == list(PSM_JOINTS)
    assert all(joint["rmse"] < joint["raw_rmse"] for joint in done.deployment["joints"][3:])
    assert not calibrate.calibrate_robot(Project(project.folder, SHORT)).repeated


def test_kinds_follow_the_projects_robot():
    assert project_kind(ProjectSettings(side="right")).robot == "raven2_right"
    assert [topic.name for topic in project_kind(replace(SHORT, namespace="/PSM2")).required] == [
        "/PSM2/measured_js",
        "/PSM2/tracker/measured_js",
    ]


def test_a_psms_motions_stay_within_its_limits():
    plant, motion = PsmPlant(), project_kind(SHORT).excitation()[0]
    rows = motion.sample(np.arange(0.0, 60.0, 0.05))[0]
    assert (rows > plant.lower[:6]).all()
    assert (rows < plant.upper[:6]).all()


def test_a_zigzag_ends_with_half_a_minute_of_random_motion_in_the_same_box() -> None:
    """From the measurement of one joint a time late the recording then tells it; a zig-zag does not."""
    plant, short = homed_raven(), ProjectSettings(direction="J2-J3", sparsities=(1 / 2,))
    (whole, what), (alone, without) = (
        project_kind(replace(short, random_seconds=seconds)).excitation() for seconds in (30.0, 0.0)
    )
    assert what == without | {"random": 30.0}
    assert 30.0 < whole.duration - alone.duration < 40.0
    q, qd, _ = whole.sample(np.arange(alone.duration, whole.duration, 0.01))
    assert ((q > CALIBRATION_LOWER - 1e-9) & (q < CALIBRATION_UPPER + 1e-9)).all()
    assert (np.abs(qd) <= [0.201, 0.201, 0.01005]).all()
    log = record_simulated(plant, whole, "both", np.random.default_rng(0))
    both, zigzag = (width_of(part) for part in (log, log.part(0, int(30 * alone.duration))))
    assert (both < 0.5 * zigzag).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"robot": "panda"}, "robot: expected one of raven2, dvrk_psm, got panda"),
        ({"namespace": "/MTML"}, "begins with PSM"),
        ({"payload_kg": 0.1}, "has neither --side nor --payload"),
        ({"side": "right"}, "has neither --side nor --payload"),
        ({"train_minutes": 0.0}, "training motion: expected"),
    ],
)
def test_settings_that_a_psm_cannot_have_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        replace(SHORT, **change)


def test_a_psm_goes_on_where_it_was_put_away(tmp_path):
    left, found = homed_psm(), PsmPlant()
    left.servo_jr(np.array([0.002, 0.0, 0.0, 0.005, 0.0, 0.0, 0.0]))
    for _ in range(50):
        left.wait()
    left.state_command("pause")
    save_plant(left, tmp_path / "arm.npz")
    restore_plant(found, tmp_path / "arm.npz")
    for plant in (left, found):
        plant.state_command("enable" if plant is found else "resume")
        for _ in range(20):
            plant.wait()
    assert_allclose(found.telemetry()["jpos"], left.telemetry()["jpos"], atol=0.0)
    assert found.state == left.state
