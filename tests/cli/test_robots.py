from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import simulated_arm
from catenary.dynamics.kinematics import forward_kinematics
from catenary.robots.catalog import load_robot, robot_names
from command_line import catenary, refusal

HOME = "30,90,400,0,0,0"  # deg and mm


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "arm.toml"
    path.write_text(simulated_arm.DH_TABLE)
    return path


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "bare.urdf"
    path.write_text(simulated_arm.URDF_WITHOUT_INERTIA)
    return path


def test_robots_lists_the_catalogue_with_its_units() -> None:
    content = catenary("robots", "--json").json
    assert [robot["name"] for robot in content] == list(robot_names())
    assert "shoulder [rad], elbow [rad], insertion [m]" in catenary("robots").out


def test_fk_gives_the_pose_in_metres_and_as_a_quaternion() -> None:
    content = catenary("fk", "raven2_full", "--q-deg", HOME, "--json").json
    model = load_robot("raven2_full")
    pose = forward_kinematics(model, [np.pi / 6, np.pi / 2, 0.4, 0.0, 0.0, 0.0])
    assert_allclose(content["position"], pose.position, atol=1e-15)
    assert_allclose(content["rotation"], pose.rotation, atol=1e-15)


def test_fk_takes_radians_and_metres_or_degrees_and_millimetres() -> None:
    in_si = catenary("fk", "raven2", "--q", f"{np.pi / 6!r},{np.pi / 2!r},0.4", "--json").json
    shown = catenary("fk", "raven2", "--q-deg", "30,90,400", "--json").json
    assert_allclose(in_si["position"], shown["position"], atol=1e-15)


def test_fk_takes_negative_first_coordinates() -> None:
    assert catenary("fk", "two_link", "--q", "-0.5,1").code == 0


def test_fk_shows_the_pose_in_the_frame_asked_for() -> None:
    content = catenary("fk", "raven2", "--q-deg", "30,90,400", "--in", "frame0", "--json").json
    assert content["in"] == "frame0"
    assert "frame0" in catenary("fk", "raven2", "--q-deg", "30,90,400").out


def test_fk_says_when_a_joint_is_beyond_its_limits() -> None:
    outcome = catenary("fk", "raven2", "--q", "0.5,1.5,400", "--json")
    assert outcome.err == "note: insertion: 400 m is outside its limits, 0.23 to 0.56 m\n"
    assert outcome.json["frame"] == "wrist"


def test_fk_reads_a_table(table: Path) -> None:
    content = catenary("fk", table, "--q-deg", "90,100", "--json").json
    # the slide's frame stands 0.3 m along the turned x axis; alpha turns its z from up to against y, then it moves
    assert_allclose(content["position"], [0.2, 0.3, 0.0], atol=1e-12)


def test_fk_works_without_inertia(urdf: Path) -> None:
    assert_allclose(
        catenary("fk", urdf, "--q", "0,0.5", "--json").json["position"], [0.1, 0, 0.5], atol=1e-15
    )


def test_ik_undoes_fk() -> None:
    pose = catenary("fk", "raven2_full", "--q-deg", "30,90,400,10,20,30", "--json").json
    position = ",".join(repr(1000.0 * x) for x in pose["position"])
    quaternion = ",".join(map(repr, pose["quaternion"]))
    content = catenary(
        "ik", "raven2_full", "--position-mm", position, "--quaternion", quaternion, "--json"
    ).json
    assert_allclose(content["q"], [*np.deg2rad([30, 90]), 0.4, *np.deg2rad([10, 20, 30])], atol=1e-9)


def test_ik_takes_roll_pitch_and_yaw_about_fixed_axes() -> None:
    angles = (-38.1, 69.9, -27.6)
    outcome = catenary(
        "ik", "raven2_full", "--position-mm=25.3,-13.2,-77.9", "--rpy-deg", "-38.1,69.9,-27.6", "--json"
    )
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.deg2rad(angles)), np.sin(np.deg2rad(angles))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    assert_allclose(outcome.json["reached"]["rotation"], about_z @ about_y @ about_x, atol=1e-9)


def test_ik_of_a_position_leaves_the_orientation_free() -> None:
    content = catenary("ik", "raven2", "--position-mm", "19,-7.4,-67", "--json").json
    assert_allclose(content["reached"]["position"], [0.019, -0.0074, -0.067], atol=1e-9)
    assert content["goal"]["quaternion"] is None
    assert " any" in catenary("ik", "raven2", "--position-mm", "19,-7.4,-67").out


def test_ik_does_not_ignore_an_orientation_that_three_joints_cannot_reach() -> None:
    message = refusal("ik", "raven2", "--position-mm", "19,-7.4,-67", "--rpy-deg", "0,0,0")
    assert "did not reach the pose" in message


def test_ik_of_joints_reaches_their_pose() -> None:
    content = catenary("ik", "raven2", "--q", "0.5,1.5,0.4", "--json").json
    assert_allclose(content["q"], [0.5, 1.5, 0.4], atol=1e-9)


def test_ik_is_the_same_for_the_same_seed() -> None:
    first, second = (catenary("ik", "two_link", "--position-mm", "500,0,500", "--seed", 3) for _ in range(2))
    assert first == second


def test_ik_in_another_frame_at_rest() -> None:
    content = catenary("ik", "raven2", "--position-mm=-67,-19,7.4", "--in", "frame0", "--json").json
    assert_allclose(content["reached"]["position"], [-0.067, -0.019, 0.0074], atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fk", "raven2"], "give its 3 joints with --q (rad, m) or --q-deg (deg, mm): shoulder [rad]"),
        (["fk", "raven2", "--q", "1,1,0.4", "--q-deg", "1,1,1"], "give its 3 joints with --q"),
        (["fk", "raven2", "--q", ""], "--q: expected numbers"),
        (["fk", "raven2", "--q", "a,b,c"], "got 'a'"),
        (["fk", "raven2", "--q", "nan,1,0.4"], "--q: expected 3 finite numbers"),
        (["fk", "raven2", "--q-deg", "inf,1,400"], "--q-deg: expected 3 finite numbers"),
        (["fk", "raven2", "--q", "1,2"], "expected 3 finite numbers for shoulder [rad], elbow [rad]"),
        (["fk", "raven2", "--q", "1,1,0.4", "--frame", "nose"], 'no frame "nose"; frames: base'),
        (["fk", "raven2", "--q", "1,1,0.4", "--in", "nose"], 'no frame "nose"; frames: base'),
        (["fk", "raven9", "--q", "1"], 'did you mean "raven2"'),
        (["fk", "", "--q", "1"], "neither a file nor in the catalogue"),
        (["ik", "raven2"], "give the goal with --position-mm"),
        (["ik", "raven2", "--rpy-deg", "0,0,0"], "give the goal with --position-mm"),
        (["ik", "raven2", "--q", "0.5,1.5,0.4", "--rpy-deg", "0,0,0"], "give both"),
        (["ik", "raven2", "--position-mm", "1e6,0,0"], 'joint "insertion"'),
        (["ik", "raven2", "--position-mm", "0,0"], "--position-mm: expected shape (3,)"),
        (["ik", "raven2", "--position-mm", "nan,0,0"], "--position-mm[0] is nan"),
        (["ik", "raven2_full", "--position-mm", "0,0,0", "--rpy-deg", "0,0,0"], "from the remote centre"),
        (["ik", "raven2_full", "--position-mm", "0,0,1", "--quaternion", "0,0,0,0"], "quaternion"),
        (["ik", "raven2_full", "--position-mm", "0,0,1", "--quaternion", "1,0,0"], "quaternion"),
        (["ik", "raven2_full", "--position-mm", "0,0,1", "--rpy-deg", "0,0"], "--rpy-deg"),
        (
            ["ik", "raven2", "--position-mm", "0,0,1", "--rpy-deg", "0,0,0", "--quaternion", "1,0,0,0"],
            "one of",
        ),
        (["ik", "raven2", "--position-mm", "0,0,1", "--frame", "nose"], 'no frame "nose"'),
        (["ik", "raven2", "--position-mm", "0,0,1", "--in", "nose"], 'no frame "nose"'),
        (
            ["ik", "raven2", "--position-mm", "0,0,1", "--in", "wrist"],
            "moves with the joints; expected one of base",
        ),
        (["ik", "two_link", "--position-mm", "5000,0,0"], "did not reach the position: nearest"),
        (["ik", "two_link", "--position-mm", "500,0,0", "--seed", "-1"], "--seed"),
    ],
)
def test_bad_input_is_refused_with_a_reason(arguments: list[str], words: str) -> None:
    assert words in refusal(*arguments)
