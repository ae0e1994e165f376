from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import simulated_arm
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from command_line import catenary, refusal

DOWN = np.array([0.0, 0.0, -9.81])
POSE = ("raven2", "--q", "0,1.57,0.32")
ARM = load_robot("raven2")


def test_gravity_gives_torques_with_their_units() -> None:
    content = catenary("gravity", *POSE, "--json").json
    assert_allclose(content["tau"], gravity_torque(ARM, [0.0, 1.57, 0.32], DOWN), rtol=1e-15)
    assert content["unit"] == ["Nm", "Nm", "N"]
    assert content["level"] == content["tau"]


def test_gravity_takes_degrees_and_millimetres() -> None:
    shown = catenary("gravity", "raven2", "--q-deg", "0,90,320", "--json").json
    assert_allclose(shown["tau"], [1.5120, -0.1962, 2.1879], atol=1e-4)  # published for the mechanism


def test_tilt_rolls_about_x_and_then_pitches_about_the_bases_own_y() -> None:
    content = catenary("gravity", *POSE, "--tilt-deg", "20", "-50", "--json").json
    R_world_base = Rotation.from_euler("XY", [20.0, -50.0], degrees=True)
    gravity = R_world_base.inv().apply(DOWN)
    assert_allclose(content["gravity"], gravity, atol=1e-14)
    assert_allclose(content["tau"], gravity_torque(ARM, [0.0, 1.57, 0.32], gravity), atol=1e-13)


def test_gravity_may_be_any_vector() -> None:
    content = catenary("gravity", *POSE, "--gravity", "1", "-2", "-3.5", "--json").json
    assert_allclose(content["tau"], gravity_torque(ARM, [0.0, 1.57, 0.32], [1.0, -2.0, -3.5]), rtol=1e-15)


def test_table_shows_the_difference_to_a_level_base() -> None:
    out = catenary("gravity", *POSE, "--tilt-deg", "0", "20").out
    shoulder = next(line for line in out.splitlines() if "shoulder" in line).split()
    assert shoulder[-1] == "Nm"
    assert float(shoulder[3]) == pytest.approx(float(shoulder[1]) - float(shoulder[2]), abs=2e-4)


def test_gravity_takes_a_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(simulated_arm.DH_TABLE)
    content = catenary("gravity", path, "--q", "0,0.1", "--gravity", "0", "-9.81", "0", "--json").json
    assert_allclose(content["tau"], [0.2 * 9.81, 0.0], rtol=1e-12)  # 1 kg, 0.2 m along x


def test_gravity_refuses_a_robot_without_inertia_by_its_links(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(simulated_arm.URDF_WITHOUT_INERTIA)
    assert '"upper", "fore"' in refusal("gravity", path, "--q", "0,0.1")


def test_gravity_notes_a_joint_beyond_its_limits() -> None:
    assert "insertion" in catenary("gravity", "raven2", "--q", "0,1.57,32", "--json").err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*POSE, "--tilt-deg", "0", "20", "--gravity", "0", "0", "-9.81"), "one of --tilt-deg and --gravity"),
        ((*POSE, "--tilt-deg", "nan", "20"), "--tilt-deg: expected finite"),
        ((*POSE, "--gravity", "inf", "0", "0"), "gravity"),
        (("raven2", "--q", "0,1"), "expected 3 finite numbers"),
        (("raven2",), "give its 3 joints"),
        (("nobody", "--q", "0"), "neither a file nor in the catalogue"),
    ],
)
def test_gravity_refuses_bad_input(arguments: tuple[str, ...], message: str) -> None:
    assert message in refusal("gravity", *arguments)


def test_track_tells_error_and_pd_share_and_writes_a_page(tmp_path: Path) -> None:
    page = tmp_path / "track.html"
    content = catenary(
        "track", "raven2", "--motion", "random", "--seconds", "2", "--controller", "dg", "--seed", "3",
        "--report", page, "--json",
    ).json  # fmt: skip
    assert content["simulated"]
    assert content["controller"] == "dg"
    assert [joint["name"] for joint in content["joints"]] == list(ARM.joint_names)
    for joint in content["joints"]:
        assert 0.0 < joint["rms_error"] < 1.0  # deg, mm
        assert joint["pd_share_percent"] > 0.0
    assert "Simulated" in page.read_text() or "simulated" in page.read_text()


def test_track_shows_a_table() -> None:
    out = catenary("track", "raven2", "--motion", "random", "--seconds", "2", "--controller", "pd").out
    assert "100.0 %" in out


def test_hold_tells_the_drift_of_every_joint() -> None:
    content = catenary(
        "hold", "raven2", "--q-deg", "50,90,400", "--seconds", "0.5", "--base-tilt-deg", "0", "-25", "--json"
    ).json
    assert content["seconds"] == 0.5
    assert content["joints"][0]["drift"] < 0.1
    table = catenary("hold", "raven2", "--seconds", "0.2", "--controller", "sg").out
    assert "shoulder" in table


def test_hold_writes_a_page_with_the_drift_over_time(tmp_path: Path) -> None:
    page = tmp_path / "hold.html"
    out = catenary(
        "hold", "two_link", "--q-deg", "30,40", "--seconds", "0.2", "--base-tilt-deg", "0", "90", "--report", page
    ).out  # fmt: skip
    assert str(page) in out
    text = page.read_text()
    assert "Distance of every joint from where it began" in text
    assert "0, 90" in text  # the base's tilt
    assert "none does not exist" in refusal("hold", "two_link", "--report", tmp_path / "none" / "hold.html")


def test_any_other_robot_is_held_and_moved_as_rigid_bodies() -> None:
    held = catenary(
        "hold", "two_link", "--q-deg", "30,40", "--seconds", "0.2", "--base-tilt-deg", "0", "90", "--json"
    ).json
    assert max(joint["drift"] for joint in held["joints"]) < 1e-3
    moved = catenary("track", "dual_arm_19", "--motion", "random", "--seconds", "2", "--json").json
    assert len(moved["joints"]) == 19


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("track", "two_link", "--seed", "1"), "a seed draws the cables of raven2 or raven2_right"),
        (("track", "raven2", "--controller", "best"), "expected one of pd, sg, dg"),
        (("track", "raven2", "--motion", "dance"), "expected one of cartesian, random, poses"),
        (("track", "raven2", "--damping", "none"), "expected one of relative, absolute"),
        (("track", "raven2", "--report", "/nowhere/page.html"), "folder /nowhere does not exist"),
        (("track", "raven2", "--base-tilt-deg", "nan", "0"), "--base-tilt-deg: expected finite"),
        (("track", "raven2", "--amplitude-mm", "400"), "Cartesian"),
        (("hold", "raven2", "--controller", "pd"), "expected one of sg, dg"),
        (("hold", "raven2", "--q-deg", "120,90,400"), "outside"),
        (("hold", "raven2", "--seconds", "0"), "seconds: expected more than 0"),
    ],
)
def test_bad_input_is_refused_before_anything_moves(arguments: tuple[str, ...], message: str) -> None:
    assert message in refusal(*arguments)
