"""Layouts that messages share, beside rosbags' bytes and what writes field by field."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.crtk.codec import codec
from catenary.crtk.dds.cdr import cdr_encoder
from catenary.crtk.message import header, message_class
from catenary.crtk.packing import MOST
from catenary.errors import InputError
from catenary.recording.messages import ros2_name, typestore

NAME = "sensor_msgs/JointState"
JointState = message_class(NAME)
texts = st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=9)


@given(
    st.lists(
        st.tuples(texts, st.lists(texts, max_size=4), st.integers(0, 4), st.integers(0, 2**40)), min_size=2
    )
)
@settings(deadline=None, max_examples=50)
def test_texts_and_lengths_that_change_have_layouts_of_their_own(shapes) -> None:
    """rosbags reads each message, of either ROS, as it was written, whichever came before it."""
    for frame, names, count, stamp in shapes:
        message = JointState(header(stamp, frame), tuple(names), np.arange(float(count)), (), [0.5])
        read = (
            typestore().deserialize_ros1(codec(NAME).encode(message, 3), ros2_name(NAME)),
            typestore(2).deserialize_cdr(cdr_encoder(NAME)(message), ros2_name(NAME)),
        )
        for one in read:
            assert (one.header.frame_id, one.name) == (frame, names)
            assert one.header.stamp.sec * 10**9 + one.header.stamp.nanosec == stamp
            assert one.position.tolist() == [*range(count)]
            assert (one.velocity.tolist(), one.effort.tolist()) == ([], [0.5])


def test_more_shapes_than_are_kept_are_written_too() -> None:
    for k in (*range(MOST + 5), 0):
        data = cdr_encoder(NAME)(JointState(header(k, f"frame{k}")))
        assert typestore(2).deserialize_cdr(data, ros2_name(NAME)).header.frame_id == f"frame{k}"


@pytest.mark.parametrize(
    ("place", "wrong"),
    [
        ("orientation", message_class("geometry_msgs/Point")(1.0, 2.0, 3.0)),
        ("position", message_class("geometry_msgs/Vector3")(1.0, 2.0, 3.0)),  # of the same fields
        ("position", message_class("geometry_msgs/Point")("1.0", 2.0, 3.0)),
    ],
)
def test_what_does_not_fit_is_refused_by_its_field(place: str, wrong) -> None:
    pose = message_class("geometry_msgs/Pose")()._replace(**{place: wrong})
    message = message_class("geometry_msgs/PoseStamped")(header(1, "base"), pose)
    for encode in (lambda: codec("geometry_msgs/PoseStamped").encode(message, 0),
                   lambda: cdr_encoder("geometry_msgs/PoseStamped")(message)):  # fmt: skip
        with pytest.raises(InputError, match=place):
            encode()
