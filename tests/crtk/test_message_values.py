import itertools
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catenary.crtk import message_values
from catenary.crtk.message import codec, has_header, header, message_class, message_fields, stamp_of
from catenary.errors import FileFormatError, InputError
from catenary.spatial import Pose
from catenary.topics import SECOND
from oracles.ticking_clock import SetClock

NAMES = ("shoulder", "elbow", "insertion")
Q = np.array([0.1, 0.2, 0.3])
XYZ = message_class("geometry_msgs/Vector3")(0.5, -0.25, 9.75)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_numbers_go_to_the_joints_of_their_names_in_any_order(order: tuple[int, ...]) -> None:
    message = message_values.joint_state_message(tuple(NAMES[i] for i in order), 1, Q[list(order)])
    assert_array_equal(message_values.joint_values(message, NAMES), Q)


def test_numbers_without_names_are_taken_in_our_order_the_first_of_them() -> None:
    message = message_class("sensor_msgs/JointState")(position=np.array([0.1, 0.2, 0.3, 9.0]))
    assert_array_equal(message_values.joint_values(message, NAMES), Q)


@pytest.mark.parametrize(
    ("names", "values", "complaint"),
    [
        (("shoulder", "elbow"), [1, 2], "missing: insertion"),
        (("shoulder", "elbow", "wrist"), [1, 2, 3], "unknown: wrist; missing: insertion"),
        (("shoulder", "elbow", "insertion", "elbow"), [1, 2, 3, 4], "given twice: elbow"),
        (("shoulder", "elbow", "insertion"), [1, 2], "2 numbers for 3 names"),
        (("shoulder", "elbow", "insertion"), [1, 2, np.nan], r"position\[2\] is nan"),
        ((), [1, 2], "without names, expected 3"),
    ],
)
def test_what_fits_no_joint_is_refused(names: tuple[str, ...], values: list[float], complaint: str) -> None:
    message = message_class("sensor_msgs/JointState")(name=names, position=np.array(values, dtype=float))
    with pytest.raises(InputError, match=complaint):
        message_values.joint_values(message, NAMES)


@pytest.mark.parametrize(
    ("read", "kind", "fields", "complaint"),
    [
        (message_values.pose_of, "geometry_msgs/PoseStamped", {}, "expected length 1, got 0"),  # it was never set
        (message_values.pose_of, "geometry_msgs/TransformStamped", {}, "expected length 1, got 0"),
        (message_values.pose_of, "std_msgs/String", {}, "got String"),
        (message_values.operating_state, "crtk_msgs/OperatingState", {"state": "asleep"},
         '"asleep": expected DISABLED, ENABLED, PAUSED, FAULT'),
    ],
)  # fmt: skip
def test_a_message_that_does_not_say_it_is_refused(read, kind, fields, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        read(message_class(kind)(**fields))


def test_a_joint_state_of_another_length_is_not_made() -> None:
    with pytest.raises(InputError, match="velocity: expected 3 numbers"):
        message_values.joint_state_message(NAMES, 1, Q, Q[:2])


def test_a_joint_state_survives_the_way_there_and_back() -> None:
    sent = message_values.joint_state_message(NAMES, 1_700_000_000_500_000_000, Q, 2 * Q, 3 * Q)
    one = codec("sensor_msgs/JointState")
    got = message_values.joint_state(one.decode(one.encode(sent, 1)), NAMES, gravity=(0.0, 0.0, -9.81))
    assert got.time == 1_700_000_000.5
    assert_array_equal(np.stack([got.q, got.qd, got.tau]), np.stack([Q, 2 * Q, 3 * Q]))
    assert_array_equal(got.gravity, [0.0, 0.0, -9.81])
    assert got.gravity_age == np.inf


def test_velocities_that_were_not_sent_are_nan_and_not_zero() -> None:
    got = message_values.joint_state(message_values.joint_state_message(NAMES, 1, Q), NAMES, gravity=np.zeros(3))
    assert np.isnan(got.qd).all()
    assert np.isnan(got.tau).all()


def random_pose(seed: int) -> Pose:
    rng = np.random.default_rng(seed)
    return Pose(Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3))


@given(st.integers(0, 2**31), st.sampled_from([None, "tool"]))
@settings(deadline=None)
def test_a_pose_survives_the_way_there_and_back(seed: int, child: str | None) -> None:
    pose = random_pose(seed)
    message = message_values.pose_message(pose, 5, "base", child=child)
    kind = "geometry_msgs/PoseStamped" if child is None else "geometry_msgs/TransformStamped"
    got = message_values.pose_of(codec(kind).decode(codec(kind).encode(message, 1)))
    assert_allclose(got.rotation, pose.rotation, atol=1e-14)  # rounding of a quaternion
    assert_array_equal(got.position, pose.position)


def test_quaternions_are_sent_with_w_last() -> None:
    quarter = Pose(Rotation.from_euler("z", 90, degrees=True).as_matrix(), np.zeros(3))
    turn = message_values.pose_message(quarter, 5, "base").pose.orientation
    assert turn._fields == ("x", "y", "z", "w")
    assert_allclose(turn, [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], atol=1e-15)  # axis sin, cos of 45 degrees


def stamped(steps: list[float], pause: float = 0.001, behind: float = 1.2) -> tuple[list[int], list[int], list[bool]]:
    """Stamps of messages while the clock is set by steps [s], each `behind` [s] after the last one.

    Also what the clock said of each, and whether it had just been set.
    """
    clock = SetClock()
    stamps = message_values.Stamps(clock)
    given_out, days, sets = [], [], []
    for step in (0.0, *steps):
        clock.ahead += round(step * SECOND)
        for k in range(round(behind / pause)):
            clock.sleep(pause)
            given_out.append(stamps.next(clock.steady()))
            days.append(clock.now())
            sets.append(k == 0)
    return given_out, days, sets


@given(st.lists(st.floats(-1e4, 1e4) | st.floats(-0.6, 0.6), max_size=4), st.sampled_from([0.001, 0.02, 0.3]))
@settings(deadline=None, max_examples=30)
def test_stamps_go_back_only_where_the_clock_is_set_back_far_and_are_right_a_second_later(
    steps: list[float], pause: float
) -> None:
    given_out, days, sets = stamped(steps, pause)
    for (a, b), (before, day), is_set in zip(
        itertools.pairwise(given_out), itertools.pairwise(days), sets[1:], strict=True
    ):
        assert a < b or (is_set and before + pause * SECOND - day > message_values._CLOCK_LEAP_NS)
    assert all(0 <= stamp - day <= message_values._CLOCK_LEAP_NS for stamp, day in zip(given_out, days, strict=True))
    seconds = round(1.2 / pause)
    assert_allclose(  # nanoseconds that a message is later than the last one, at the least
        given_out[seconds - 1 :: seconds], days[seconds - 1 :: seconds], rtol=0, atol=10 * len(given_out)
    )


@pytest.mark.parametrize("by", [-0.4, -0.01])
def test_stamps_go_at_half_speed_while_the_clock_waits_for_them(by: float) -> None:
    given_out, days, _ = stamped([by])
    steps = np.diff(given_out)
    assert steps.min() >= 0.5 * 0.001 * SECOND  # and never by a nanosecond each
    assert given_out[-1] == days[-1]


@pytest.mark.parametrize(("by", "said"), [(-3600.0, "-3600.000"), (7.5, r"\+7.500"), (-0.4, None), (0.4, None)])
def test_a_clock_that_is_set_far_is_said_once(by: float, said: str | None, caplog) -> None:
    stamped([by])
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == (said is not None)
    assert all(re.search(f"the clock was set by {said} s", line) for line in lines)


def test_a_message_and_its_default_arrays_which_others_share_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        message_class("std_msgs/String")(data="a").data = "b"
    with pytest.raises(ValueError, match="read-only"):
        message_class("raven_2/raven_state")().jpos[0] = 1.0


def test_old_and_new_names_give_the_same_class() -> None:
    assert message_class("crtk_msgs/operating_state") is message_class("crtk_msgs/OperatingState")


def test_header_is_found_whatever_its_name_and_its_stamp_is_the_messages() -> None:
    assert has_header("raven_2/raven_state")  # hdr
    assert has_header("sensor_msgs/Imu")
    assert not has_header("std_msgs/Header")
    assert not has_header("std_msgs/Empty")
    assert stamp_of(message_class("raven_2/raven_state")(hdr=header(12, "base"))) == 12
    assert stamp_of(message_class("std_msgs/Empty")()) is None
    assert stamp_of(message_class("std_msgs/Bool")(data=True)) is None


def test_an_unknown_type_and_a_message_of_another_are_refused() -> None:
    with pytest.raises(FileFormatError, match="unknown"):
        message_class("raven_2/raven_mood")
    with pytest.raises(InputError, match="OperatingState"):
        message_fields("crtk_msgs/OperatingState", np.zeros(3))
