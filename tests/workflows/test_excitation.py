import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rosbags.typesys import Stores, get_typestore

from catenary.collision.scene import floor_at
from catenary.errors import InputError
from catenary.identification.excitation import motion_room
from catenary.robots.catalog import load_robot
from catenary.robots.shapes import load_geometry
from catenary.workflows.excitation import MotionSurroundings, design_excitation, write_motion, write_trajectory
from catenary.workflows.robot.operator_motion import read_followed_file
from colliding_arm import PANDA

GEOMETRY = load_geometry("panda", PANDA)
ROOM = motion_room(PANDA)
LEVEL = np.array([0.0, 0.0, -9.81])


def design(around=None, model=PANDA, room=ROOM, **options):
    shape = {"trials": 4, "rate": 50.0} if "static" not in options else {}
    around = MotionSurroundings(GEOMETRY, (floor_at(0.0),)) if around is None else around
    return design_excitation(model, room, around, np.random.default_rng(0), gravity=LEVEL, **shape, **options)


@pytest.fixture(scope="module")
def motion():
    return design()


def test_a_design_says_what_it_keeps_and_what_is_assumed(motion):
    summary = motion.summary()
    assert summary["collisions"]["checked"]
    assert summary["collisions"]["assumed"]
    assert summary["collisions"]["closest"]["distance_mm"] >= 10.0
    assert max(summary["torque_share"]) <= 1.0
    assert any("shapes are assumed, not measured" in note for note in motion.notes)
    assert any("in every pose, and not compared" in note for note in motion.notes)
    kept = " ".join(motion.kept())
    assert "torques: at most" in kept
    assert "collisions: none at any instant" in kept


def test_torques_that_cannot_be_told_are_said_to_be_unchecked():
    raven = load_robot("raven2")
    room = motion_room(raven, velocity=[1.0, 1.0, 0.1])
    found = design(MotionSurroundings(load_geometry("raven2", raven)), raven, room)
    assert any("torques are unchecked: raven2 has no limits of them" in note for note in found.notes)
    assert any("only self-collisions are checked" in note for note in found.notes)
    bare = load_robot("dvrk_psm_motors")
    room = motion_room(bare, lower=-np.full(7, 1.5), upper=np.full(7, 1.5), velocity=np.full(7, 3.0), effort=np.ones(7))
    found = design(MotionSurroundings(None, unchecked="no shapes"), bare, room)
    assert any("torques are unchecked: dvrk_psm_motors has no masses" in note for note in found.notes)


def test_poses_are_free_and_their_ways_said_to_be_unchecked():
    found = design(static=15)
    assert "the ways from pose to pose are not checked" in found.notes[-1]
    assert "collisions: none in any pose" in found.kept()[-1]


def test_a_trajectory_is_ros_s_message(motion, tmp_path):
    for ros, keys in ((2, ("sec", "nanosec")), (1, ("secs", "nsecs"))):
        path = tmp_path / "motion.json"
        write_trajectory(motion.design, PANDA.joint_names, path, ros=ros)
        content = json.loads(path.read_text())
        assert content["joint_names"] == list(PANDA.joint_names)
        assert len(content["points"]) == len(motion.design.q)
        last = content["points"][-1]
        stamp = last["time_from_start"]
        assert tuple(stamp) == keys
        assert stamp[keys[0]] + 1e-9 * stamp[keys[1]] == pytest.approx(10.0)
        assert_allclose(content["points"][7]["positions"], motion.design.q[7])
        assert_allclose(content["points"][7]["velocities"], motion.design.qd[7])
        assert_allclose(content["points"][7]["accelerations"], motion.design.qdd[7])
    known = {
        field for field, _ in get_typestore(Stores.ROS2_HUMBLE).fielddefs["trajectory_msgs/msg/JointTrajectoryPoint"][1]
    }
    assert set(content["points"][0]) <= known
    with pytest.raises(InputError, match="a trajectory needs a motion"):
        write_trajectory(replace(motion.design, terms="static"), PANDA.joint_names, path)


def test_a_motion_that_was_written_can_be_followed(motion, tmp_path):
    made = motion.design
    for name in ("motion.npz", "motion.csv"):
        write_motion(tmp_path / name, PANDA, made.time, made.q, made.qd, made.qdd)
        followed = read_followed_file(tmp_path / name)
        assert followed.joint_names == PANDA.joint_names
        assert followed.joint_units == PANDA.joint_units
        assert_allclose(followed.q_nominal, motion.design.q)
        assert_allclose(followed.time, motion.design.time)
