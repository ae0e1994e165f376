"""Bytes of messages, ROS 1's and CDR, against rosbags, which writes its own objects of the same values."""

import contextlib
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.message import CDR, HEADER, ROS1, Encoding, codec, has_header, header, message_class
from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import MESSAGES, NUMBERS, SERVICES, TIMES, Field, fields, ros2_name, typestore
from oracles.random_messages import assert_same, random_message

HALVES = [f"{service}{half}" for service in SERVICES for half in ("Request", "Response")]
HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
JOINTS, STATE = "sensor_msgs/JointState", "raven_2/raven_state"
JointState, RavenState = message_class(JOINTS), message_class(STATE)
both = pytest.mark.parametrize("encoding", [ROS1, CDR], ids=["ROS 1", "CDR"])


def rosbags_bytes(name: str, message: Any, ros: int) -> bytes:
    """The bytes that rosbags writes of the same values."""
    store = typestore(ros)
    write = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    return bytes(write(rosbags_object(name, message, ros), ros2_name(name)))


def rosbags_object(name: str, message: Any, ros: int) -> Any:
    made = {
        field.name: rosbags_value(field, value, ros)
        for field, value in zip(fields(name), message, strict=True)
        if not (ros == 2 and name == HEADER and field.name == "seq")
    }
    return typestore(ros).types[ros2_name(name)](**made)


def rosbags_value(field: Field, value: Any, ros: int) -> Any:
    if field.length is not None and field.type not in NUMBERS:
        return [rosbags_value(field._replace(length=None), one, ros) for one in value]
    if field.type in TIMES:
        kind = typestore(ros).types[f"builtin_interfaces/msg/{field.type.capitalize()}"]
        return kind(*divmod(value, 10**9))
    if field.type in NUMBERS or field.type == "string":
        return value if field.length is None else np.asarray(value, NUMBERS[field.type])
    return rosbags_object(field.type, value, ros)


def test_a_joint_state_is_the_bytes_that_ros_describes() -> None:
    message = JointState(
        header(3 * 10**9 + 5, "base"), ("a", "bc"), np.array([1.5, -2.0]), np.zeros(0), np.array([0.25])
    )
    expected = (
        struct.pack("<IIII4s", 7, 3, 5, 4, b"base")
        + struct.pack("<I I1s I2s", 2, 1, b"a", 2, b"bc")
        + struct.pack("<Idd I Id", 2, 1.5, -2.0, 0, 1, 0.25)
    )
    assert codec(JOINTS).encode(message, 7) == expected


@both
@pytest.mark.parametrize("name", [*MESSAGES, *HALVES])
def test_bytes_of_every_type_are_rosbags_and_read_back(encoding: Encoding, name: str) -> None:
    rng = np.random.default_rng(7)
    for message in (message_class(name)(), *(random_message(name, rng) for _ in range(5))):
        check(name, encoding, message)


def check(name: str, encoding: Encoding, message: Any) -> None:
    one = codec(name, encoding)
    data = one.encode(message, message[0].seq if has_header(name) else 0)
    assert data == rosbags_bytes(name, message, encoding.ros)
    if encoding is ROS1:
        assert_same(one.decode(data), message)
        return
    # without the numbers of its headers; rosbags' converter is another judge, and so is the field list of Humble
    known = bytes(typestore(2).cdr_to_ros1(data, ros2_name(name)))
    assert_same(one.decode(data), codec(name).decode(known))
    if ros2_name(name) in HUMBLE.fielddefs:
        assert bytes(HUMBLE.serialize_cdr(HUMBLE.deserialize_cdr(data, ros2_name(name)), ros2_name(name))) == data


TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)


@both
@given(TEXTS, st.lists(TEXTS, max_size=4), st.integers(0, 4), st.integers(0, 2**40))
@settings(deadline=None)
def test_numbers_stand_where_they_belong_behind_texts_of_any_length(encoding, frame, names, count, stamp) -> None:
    message = JointState(header(stamp, frame), tuple(names), np.arange(float(count)), (), [0.5])
    data = codec(JOINTS, encoding).encode(message)
    assert data == rosbags_bytes(JOINTS, message, encoding.ros)
    if encoding is CDR and count:
        assert (data.rindex(struct.pack("<d", 0.5)) - len(CDR.front)) % 8 == 0


@both
@given(st.sampled_from(sorted(MESSAGES)), st.binary(max_size=300) | st.just(b"\xff" * 400))  # lengths of 4 G
@settings(deadline=None)
def test_bytes_that_are_no_message_raise_no_other_error(encoding: Encoding, name: str, data: bytes) -> None:
    with contextlib.suppress(FileFormatError):
        codec(name, encoding).decode(encoding.front + data)


@both
@pytest.mark.parametrize("cut", [0, 3, 20, 40, 979, 981])
def test_a_message_that_is_cut_off_or_too_long_is_refused(encoding: Encoding, cut: int) -> None:
    data = codec(STATE, encoding).encode(RavenState()) + bytes(encoding is ROS1)
    with pytest.raises(FileFormatError, match=f"{cut} bytes are no such message"):
        codec(STATE, encoding).decode(data[:cut])


@both
def test_arrays_are_the_receivers_own_aligned_and_writable(encoding: Encoding) -> None:
    data = codec(JOINTS, encoding).encode(JointState(header=header(1, "odd"), position=np.arange(3.0)))
    got = codec(JOINTS, encoding).decode(data)
    assert got.position.flags.aligned
    assert got.position.dtype == np.float64
    got.position[:] = 9.0
    np.testing.assert_array_equal(codec(JOINTS, encoding).decode(data).position, np.arange(3.0))


def test_seq_is_the_publishers_count() -> None:
    encode, decode = codec(STATE)
    assert decode(encode(RavenState(hdr=header(5)), 2**32 + 7)).hdr.seq == 7


@both
def test_lists_and_whole_numbers_are_taken_for_arrays(encoding: Encoding) -> None:
    encode, decode = codec(JOINTS, encoding)
    got = decode(encode(JointState(name=["a"], position=[1], effort=np.arange(2))))
    assert (got.name, got.position.tolist(), got.effort.tolist()) == (("a",), [1.0], [0.0, 1.0])


POSE = "geometry_msgs/PoseStamped"
Point, Vector3, Pose = (message_class(f"geometry_msgs/{name}") for name in ("Point", "Vector3", "Pose"))
MISFITS = [
    (JOINTS, {"position": ["a"]}, "position: expected float64"),
    (JOINTS, {"position": 1.0}, "position"),
    (JOINTS, {"position": None}, "position"),
    (JOINTS, {"name": "shoulder"}, "name: expected string.*single text"),
    (JOINTS, {"name": [3]}, "name"),
    (JOINTS, {"header": header(1)._replace(stamp=1.5)}, "header: stamp: expected time"),
    (JOINTS, {"header": header(2**32 * 10**9)}, "header: stamp"),
    (JOINTS, {"header": None}, "header"),
    (JOINTS, {"header": (0, 0)}, "header"),
    (STATE, {"jpos": np.zeros(15)}, r"jpos: expected float32\[16\]"),
    (STATE, {"encVals": np.full(16, 0.5)}, "encVals"),
    (STATE, {"encVals": np.full(16, 2**31)}, "encVals"),
    (STATE, {"runlevel": 2**31}, "runlevel"),
    (POSE, {"pose": Pose(orientation=Point(1.0, 2.0, 3.0))}, "pose: orientation"),
    (POSE, {"pose": Pose(position=Vector3(1.0, 2.0, 3.0))}, "pose: position"),  # of the same fields
    (POSE, {"pose": Pose(position=Point("1.0", 2.0, 3.0))}, "pose: position"),
    ("raven_2/raven_automove", {"tf_incr": ()}, "tf_incr"),
    ("crtk_msgs/OperatingState", {"state": 3}, "state: expected string"),
]


@both
@pytest.mark.parametrize(("name", "values", "complaint"), MISFITS)
def test_a_value_that_does_not_fit_is_refused_by_the_fields_name(encoding, name, values, complaint) -> None:
    with pytest.raises(InputError, match=complaint):
        codec(name, encoding).encode(message_class(name)(**values))


def test_a_time_before_1970_has_no_bytes_in_ros_1() -> None:
    with pytest.raises(InputError, match="header: stamp"):
        codec(JOINTS).encode(JointState(header(-1)))


@both
def test_a_message_of_another_type_is_refused(encoding: Encoding) -> None:
    with pytest.raises(InputError, match="expected a message sensor_msgs/JointState"):
        codec(JOINTS, encoding).encode(message_class("std_msgs/String")())
