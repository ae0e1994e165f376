import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.crtk.codec import codec
from catenary.crtk.message import has_header, header, message_class
from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import MESSAGES, SERVICES, ros2_name, typestore
from oracles.random_messages import assert_same, random_message


def test_a_joint_state_is_the_bytes_that_ros_describes() -> None:
    message = message_class("sensor_msgs/JointState")(
        header(3 * 10**9 + 5, "base"), ("a", "bc"), np.array([1.5, -2.0]), np.zeros(0), np.array([0.25])
    )
    expected = (
        struct.pack("<IIII4s", 7, 3, 5, 4, b"base")
        + struct.pack("<I I1s I2s", 2, 1, b"a", 2, b"bc")
        + struct.pack("<Idd I Id", 2, 1.5, -2.0, 0, 1, 0.25)
    )
    assert codec("sensor_msgs/JointState").encode(message, 7) == expected


@given(st.sampled_from(sorted(MESSAGES)), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_what_is_encoded_decodes_to_itself_and_is_rosbags_bytes(name: str, seed: int) -> None:
    message = random_message(name, np.random.default_rng(seed))
    seq = message[0].seq if has_header(name) else 0
    data = codec(name).encode(message, seq)
    assert_same(codec(name).decode(data), message)
    store = typestore()  # rosbags', whose messages are its own objects: it writes what it read as it was
    assert bytes(store.serialize_ros1(store.deserialize_ros1(data, ros2_name(name)), ros2_name(name))) == data


@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=300))
@settings(deadline=None)
def test_bytes_that_are_no_message_raise_no_other_error(name: str, data: bytes) -> None:
    with contextlib.suppress(FileFormatError):
        codec(name).decode(data)


@pytest.mark.parametrize("name", SERVICES)
def test_halves_of_services_have_codecs(name: str) -> None:
    made = message_class(f"{name}Response")(message="done")
    back = codec(f"{name}Response").decode(codec(f"{name}Response").encode(made, 0))
    assert back.message == "done"
    asked = message_class(f"{name}Request")()
    assert repr(codec(f"{name}Request").decode(codec(f"{name}Request").encode(asked, 0))) == repr(asked)


def test_names_of_joints_that_change_are_read_anew() -> None:
    made = message_class("sensor_msgs/JointState")
    one, other = codec("sensor_msgs/JointState"), made(name=("b", "a", "c"))
    for message in (made(name=("a", "b")), other, made(name=("a", "b")), made(), other):
        assert one.decode(one.encode(message, 1)).name == message.name


def test_seq_is_the_publishers_count() -> None:
    encode, decode = codec("raven_2/raven_state")
    assert decode(encode(message_class("raven_2/raven_state")(hdr=header(5)), 2**32 + 7)).hdr.seq == 7


def test_arrays_are_the_receivers_own_aligned_and_writable() -> None:
    message = message_class("sensor_msgs/JointState")(header=header(1, "odd"), position=np.arange(3.0))
    data = codec("sensor_msgs/JointState").encode(message, 1)
    got = codec("sensor_msgs/JointState").decode(data)
    assert got.position.flags.aligned
    assert got.position.dtype == np.float64
    got.position[:] = 9.0
    np.testing.assert_array_equal(codec("sensor_msgs/JointState").decode(data).position, np.arange(3.0))


def test_lists_and_whole_numbers_are_taken_for_arrays() -> None:
    message = message_class("sensor_msgs/JointState")(name=["a"], position=[1], effort=np.arange(2))
    got = codec("sensor_msgs/JointState").decode(codec("sensor_msgs/JointState").encode(message, 1))
    assert got.position.tolist() == [1.0]
    assert got.effort.tolist() == [0.0, 1.0]
    assert got.name == ("a",)


@pytest.mark.parametrize(
    ("name", "values", "complaint"),
    [
        ("sensor_msgs/JointState", {"position": ["a"]}, "position: expected float64"),
        ("sensor_msgs/JointState", {"position": 1.0}, "position"),
        ("sensor_msgs/JointState", {"position": None}, "position"),
        ("sensor_msgs/JointState", {"name": "shoulder"}, "name: expected string"),
        ("sensor_msgs/JointState", {"name": [3]}, "name"),
        ("sensor_msgs/JointState", {"header": header(1)._replace(stamp=1.5)}, "header: stamp: expected time"),
        ("sensor_msgs/JointState", {"header": header(-1)}, "header: stamp"),
        ("sensor_msgs/JointState", {"header": header(2**32 * 10**9)}, "header: stamp"),
        ("sensor_msgs/JointState", {"header": None}, "header"),
        ("sensor_msgs/JointState", {"header": (0, 0)}, "header"),
        ("raven_2/raven_state", {"jpos": np.zeros(15)}, r"jpos: expected float32\[16\]"),
        ("raven_2/raven_state", {"encVals": np.full(16, 0.5)}, "encVals"),
        ("raven_2/raven_state", {"encVals": np.full(16, 2**31)}, "encVals"),
        ("raven_2/raven_state", {"runlevel": 2**31}, "runlevel"),
        ("raven_2/raven_automove", {"tf_incr": ()}, "tf_incr"),
        ("crtk_msgs/OperatingState", {"state": 3}, "state: expected string"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_by_the_fields_name(name, values, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        codec(name).encode(message_class(name)(**values), 1)


def test_a_message_of_another_type_is_refused() -> None:
    with pytest.raises(InputError, match="JointState"):
        codec("sensor_msgs/JointState").encode(message_class("std_msgs/String")(), 1)


@pytest.mark.parametrize("cut", [0, 3, 20, 40, 979])
def test_a_message_that_is_cut_off_or_too_long_is_refused(cut: int) -> None:
    data = codec("raven_2/raven_state").encode(message_class("raven_2/raven_state")(), 1)
    with pytest.raises(FileFormatError, match="bytes"):
        codec("raven_2/raven_state").decode(data[:cut])
    with pytest.raises(FileFormatError, match="981 bytes"):
        codec("raven_2/raven_state").decode(data + b"\0")
