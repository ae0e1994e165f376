"""Angles that were recorded within one turn come out continuous, in the turn of the commands and of the limits."""

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.recording.import_formats.importer import unwrapped
from catenary.workflows.import_recording import import_recording
from lab_bags import JOINT_STATE, Message, joint_state, write_bag


def roll(t: Floats) -> Floats:
    """Two joints [rad]: a roll that goes three turns out and back, and an elbow."""
    return np.column_stack([3.0 + 9.0 * np.sin(0.4 * t), 0.5 * np.sin(t)])


def within_a_turn(q: Floats) -> Floats:
    return np.asarray((q + np.pi) % (2.0 * np.pi) - np.pi)


@given(start=st.floats(-3.0, 3.0), speed=st.floats(-15.0, 15.0), rate=st.sampled_from([30.0, 100.0]))
def test_what_moves_slower_than_a_tenth_of_a_turn_a_row_is_brought_back(
    start: float, speed: float, rate: float
) -> None:
    q = start + speed * np.sin(np.arange(0.0, 4.0, 1.0 / rate))
    found, jumps = unwrapped(within_a_turn(q), 2.0 * np.pi)
    off = found - q
    assert_allclose(off, off[0], atol=1e-9)
    # jumps are counted where the joint leaves its turn
    assert jumps == np.count_nonzero(np.diff(np.floor((q + np.pi) / (2.0 * np.pi))))


def test_random_poses_are_left_as_they_are() -> None:
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, 2000)
    assert_array_equal(unwrapped(q, 2.0 * np.pi)[0], q)


def test_a_camera_that_counts_within_a_turn_is_interpolated_and_follows_the_motor(tmp_path: Path) -> None:
    messages: list[Message] = [
        (t, "/cmd", joint_state(("roll", "elbow"), roll(np.array([t]))[0])) for t in np.arange(0.0, 8.0, 0.01)
    ]
    messages += [
        (t, "/cam", joint_state(("roll", "elbow"), within_a_turn(roll(np.array([t])))[0]))
        for t in np.arange(0.0, 8.0, 1 / 30)
    ]
    bag = write_bag(tmp_path / "lab", "mcap", {"/cmd": JOINT_STATE, "/cam": JOINT_STATE}, messages)
    log = import_recording(bag, ["q_nominal=/cmd.position@rad", "q_encoder=/cam.position@rad"])
    assert log.q_encoder is not None
    # a straight line between samples 1/30 s apart is off by at most h^2/8 of the acceleration, 9 * 0.16 rad/s2
    assert_allclose(log.q_encoder[log.ok], log.q_nominal[log.ok], atol=9 * 0.16 / 30**2 / 8 + 1e-9)
    assert any("q_encoder of roll: jumps by a turn" in note for note in log.notes)
    assert not any("elbow" in note for note in log.notes)


def test_degrees_are_turns_of_360_and_both_may_wrap(tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.02)
    q = roll(t)
    q[:, 0] = 3.0 + 0.6 * np.sin(t)  # about pi
    seen = q + np.array([0.4, 0.01])
    table = np.column_stack([t, np.rad2deg(within_a_turn(q)), np.rad2deg(within_a_turn(seen))])
    header = "t,roll,elbow,cam_roll,cam_elbow"
    np.savetxt(tmp_path / "lab.csv", table, delimiter=",", header=header, comments="")
    log = import_recording(tmp_path / "lab.csv", ["q_nominal=roll,elbow", "q_encoder=cam_roll,cam_elbow"], units="deg")
    assert log.q_encoder is not None
    assert_allclose(log.q_nominal, q, atol=1e-9)
    assert_allclose(log.q_encoder, seen, atol=1e-9)


def test_a_joint_whose_limits_are_known_comes_out_within_them(tmp_path: Path) -> None:
    t = np.arange(0.0, 20.0, 0.02)
    q = 2.9 + 0.6 * np.cos(t)  # a Panda's sixth joint reaches from 0 to 3.75; the first row is beyond pi
    table = np.column_stack([t, within_a_turn(q), within_a_turn(q + 0.01)])
    np.savetxt(tmp_path / "lab.csv", table, delimiter=",", header="t,q6,cam", comments="")
    mapping = {"robot": "panda", "joint_names": ["q6"], "q_nominal": {"columns": "q6"}, "q_encoder": {"columns": "cam"}}
    log = import_recording(tmp_path / "lab.csv", mapping)
    assert log.q_encoder is not None
    assert_allclose(log.q_nominal[:, 0], q, atol=1e-9)
    assert_allclose(log.q_encoder[:, 0], q + 0.01, atol=1e-9)
    assert any("q6: brought within the robot's limits by +1 turn(s)" in note for note in log.notes)
