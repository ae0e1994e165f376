import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import own_base
import simulated_arm
from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot, robot_names
from command_line import catenary, refusal


def test_robots_lists_the_catalogue_with_its_units() -> None:
    content = catenary("robots", "--json").json
    assert [robot["name"] for robot in content] == list(robot_names())
    assert [robot["units"] for robot in content if robot["name"] == "raven2"] == [["rad", "rad", "m"]]


def test_robots_prints_one_line_a_robot_that_fits_into_a_terminal() -> None:
    lines = catenary("robots").out.splitlines()
    assert max(map(len, lines)) <= 80
    for name in robot_names():
        (line,) = [line for line in lines if line.split()[:1] == [name]]
        model = load_robot(name)
        assert model.tip in line
        assert model.joint_names[0] in line
        assert model.joint_names[-1] in line


def test_fk_reads_files_also_without_inertia(tmp_path: Path) -> None:
    table, urdf = tmp_path / "arm.toml", tmp_path / "bare.urdf"
    table.write_text(simulated_arm.DH_TABLE)
    urdf.write_text(simulated_arm.URDF_WITHOUT_INERTIA)
    content = catenary("fk", table, "--q-deg", "90,100", "--json").json
    # the slide's frame stands 0.3 m along the turned x axis; alpha turns its z from up to against y, then it moves
    assert_allclose(content["position"], [0.2, 0.3, 0.0], atol=1e-12)
    content = catenary("fk", urdf, "--q", "0,0.5", "--json").json
    assert_allclose(content["position"], [0.1, 0, 0.5], atol=1e-15)


def test_ik_undoes_fk() -> None:
    pose = catenary("fk", "raven2_full", "--q-deg", "30,90,400,10,20,30", "--json").json
    position = ",".join(repr(1000.0 * x) for x in pose["position"])
    quaternion = ",".join(map(repr, pose["quaternion"]))
    goal = ("--position-mm", position, "--quaternion", quaternion)
    content = catenary("ik", "raven2_full", *goal, "--json").json
    assert_allclose(content["q"], [*np.deg2rad([30, 90]), 0.4, *np.deg2rad([10, 20, 30])], atol=1e-9)


def test_ik_takes_roll_pitch_and_yaw_about_fixed_axes() -> None:
    goal = ("--position-mm=25.3,-13.2,-77.9", "--rpy-deg", "-38.1,69.9,-27.6")
    reached = catenary("ik", "raven2_full", *goal, "--json").json["reached"]["rotation"]
    expected = Rotation.from_euler("xyz", [-38.1, 69.9, -27.6], degrees=True).as_matrix()
    assert_allclose(reached, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "key", "expected"),
    [
        (("--q", "0.5,1.5,0.4"), "q", [0.5, 1.5, 0.4]),  # the pose of joints is the goal
        (("--position-mm=-67,-19,7.4", "--in", "frame0"), "reached", [-0.067, -0.019, 0.0074]),
    ],
)
def test_ik_reaches_poses_of_joints_and_in_other_frames(arguments, key, expected) -> None:
    found = catenary("ik", "raven2", *arguments, "--json").json[key]
    assert_allclose(found["position"] if key == "reached" else found, expected, atol=1e-9)


def test_fk_and_ik_take_a_files_own_base_for_base_and_say_which_frame_is_theirs(tmp_path: Path) -> None:
    file = tmp_path / "turned.urdf"
    file.write_text(own_base.URDF)
    q = np.array([0.3, -0.7])
    poses = own_base.poses(own_base.URDF, q)
    line = ("fk", file, "--q", "0.3,-0.7", "--frame", "tool0", "--json")
    for name, asked in (("base", ["--in", "base"]), ("base_link", []), ("world", ["--in", "world"])):
        found = catenary(*line, *asked)
        assert found.json["in"] == name
        assert_allclose(found.json["position"], poses[name].actInv(poses["tool0"]).translation, atol=1e-12)
        assert '"base_link" is the base frame' in found.err
        goal = ",".join(map(str, 1000 * np.array(found.json["position"])))
        solved = catenary("ik", file, "--position-mm", goal, "--frame", "tool0", *asked, "--json").json
        reached = own_base.poses(own_base.URDF, np.array(solved["q"]))
        assert_allclose(reached["tool0"].translation, poses["tool0"].translation, atol=1e-6)


def test_gravity_and_c_say_in_whose_axes_gravity_is_where_base_is_another_frame(tmp_path: Path) -> None:
    file = tmp_path / "turned.urdf"
    file.write_text(own_base.URDF)
    assert "in axes of base_link" in catenary("gravity", file, "--q", "0,0").out
    assert catenary("export", file, "--c", tmp_path / "turned.h").code == 0
    assert "in the base frame (base_link)" in (tmp_path / "turned.h").read_text()


def test_regressor_prints_what_is_identifiable() -> None:
    text = catenary("regressor", "raven2").out
    assert "m(insertion)   by itself       by itself            0.231    kg" in text
    assert "b1  mx(shoulder)" in text
    assert "without effect on any torque: m(shoulder), mz(shoulder), m(elbow)" in text


@pytest.mark.alike
@pytest.mark.parametrize(
    ("ending", "begins"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), ("", b"\x89PNG")]
)
def test_pictures_have_the_kind_that_their_names_say(tmp_path: Path, ending: str, begins: bytes) -> None:
    out = tmp_path / f"arm{ending}"
    content = catenary(
        "plot", "two_link", "--q-deg", "30,60", "--base-tilt-deg", "0,20", "--hide", "torques", "--out", out, "--json"
    ).json
    assert out.read_bytes().startswith(begins)
    assert content["out"] == str(out)
    assert_allclose(content["gravity"], [3.3552, 0.0, -9.2184], atol=1e-4)  # 9.81 sin and cos of 20 deg
    if ending == ".svg":
        assert ET.parse(out).getroot().tag.endswith("svg")
        again = catenary("plot", "two_link", "--hide", "torques", "--out", out)
        assert again.out == f"picture: {out}\n"  # one of its own kind is replaced


def test_a_robot_without_masses_is_drawn_without_torques_and_that_is_said(tmp_path: Path) -> None:
    outcome = catenary("plot", "dvrk_psm_motors", "--out", tmp_path / "psm.png")
    assert outcome.code == 0
    assert "no torques: the description gives no mass of yaw, pitch" in outcome.err


def test_a_joint_beyond_its_limits_and_gravity_upwards_are_noted(tmp_path: Path) -> None:
    err = catenary("plot", "raven2", "--q", "0,1.57,9", "--gravity", "0,0,9.81", "--out", tmp_path / "a.png").err
    assert "insertion: 9 m is outside its limits" in err
    assert "points up" in err


def test_what_is_no_picture_is_not_replaced(tmp_path: Path) -> None:
    page = tmp_path / "other.png"
    page.write_text("mine")
    assert "is something else than a picture" in refusal("plot", "raven2", "--out", page)


def test_a_models_errors_on_a_recording_are_a_figure_of_a_column_with_fonts_in_it(tmp_path: Path) -> None:
    run, model = simulated_arm.write(tmp_path / "run.npz"), tmp_path / "arm.npz"
    assert catenary("fit", run, "--model", "linear", "--out", model).code == 0
    name = read_log(run).joint_names[1]
    out = tmp_path / "figure.pdf"
    shown = catenary("plot", model, run, "--joint", name, "--out", out, "--json").json
    assert shown == {"model": str(model), "joint": name, "out": str(out)}
    pdf = out.read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    width, _ = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf)[0]
    assert float(width) == 3.5 * 72  # points
    assert "--joint x: expected one of" in refusal("plot", model, run, "--joint", "x", "--out", out)
    assert "do not go with LOG" in refusal("plot", model, run, "--payload", "1", "--out", out)
    assert "--joint: goes with LOG" in refusal("plot", "raven2", "--joint", "x", "--out", out)
