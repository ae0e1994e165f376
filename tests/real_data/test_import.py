"""The published layouts import as they are, and by a mapping give the same."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.recording.import_formats.known_layouts import read_commands
from catenary.workflows.import_recording import import_recording, propose_mapping

LAYOUTS = {
    "dvrk_calibration_berkeley/random_train.npz": (None, 5600, 6),
    "dvrk_mtm_static_gravity/grid4_pos.npz": ("dvrk_mtm", 4096, 7),
    "dvrk_wpi_dynamics/psm_one.npz": ("dvrk_psm_motors", 5999, 7),
    "panda_dynamics/panda_first60.npz": ("panda", 12326, 7),
    "tiago_dynamics/tiago_dynamic.npz": ("tiago", None, 8),
    "raven2_recorded_state/raven_state_circle.npz": (None, None, 3),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_published_layouts_need_no_mapping(name: str, recordings: Path) -> None:
    robot, rows, joints = LAYOUTS[name]
    log = import_recording(recordings / name, robot=robot)
    assert log.q_nominal.shape[1] == joints
    assert rows is None or len(log) == rows


def test_raven_s_state_comes_in_si(recordings: Path) -> None:
    path = recordings / "raven2_recorded_state" / "raven_state_circle.npz"
    log = import_recording(path)
    published, time = np.load(path)["jpos"], np.load(path)["t"]
    fresh = np.concatenate([[True], np.diff(time) != 0.0])  # stamps are of arrival, in bursts
    assert_allclose(log.q_nominal, np.deg2rad(published[fresh, :3]), atol=1e-9)
    assert any("repeated stamps were dropped" in note for note in log.notes)
    assert log.joint_units == ("rad", "rad", "m")
    assert np.abs(log.q_nominal[:, 2]).max() < 0.6  # the insertion of a RAVEN-II [m]


def test_a_command_log_by_a_mapping_is_the_layout_s_own(recordings: Path) -> None:
    path = recordings / "dvrk_calibration_berkeley" / "random_train.npz"
    mapped = import_recording(path, ["q_nominal=q_des", "q_encoder=q_act", "ok=ok"], units="rad,rad,m,rad,rad,rad")
    own = read_commands(path)
    for key in ("q_nominal", "q_encoder", "ok"):
        assert_allclose(getattr(mapped, key), getattr(own, key))


def test_a_published_trajectory_is_imported_by_its_name(recordings: Path) -> None:
    path = recordings / "raven2_zigzag" / "zigzag_reference.npz"
    name = next(name for name, values in np.load(path).items() if values.ndim == 2)
    log = import_recording(path, [f"q_nominal={name}"], units="rad,rad,m")
    assert_allclose(log.q_nominal, np.load(path)[name])
    assert propose_mapping(path).questions
