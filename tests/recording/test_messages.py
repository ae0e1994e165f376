"""Messages as bytes and as numbers, both against rosbags, and the sums by which ROS 1 tells types apart."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.raven2.topics import RAVENSTATE
from catenary.recording import messages
from catenary.recording.layout import blank_messages, encode, layout_of, read_messages
from lab_bags import JOINT_STATE, header, joint_state
from oracles.raven_recording import telemetry

# raven_2 and crtk_msgs: as the robot publishes them; the rest: rosmsg md5 on ROS Noetic
PUBLISHED = {
    "raven_2/raven_state": "ce9e7f4969049d8bb365de3c98461a01",
    "raven_2/raven_automove": "409f695c901a20d6a1f90a4e55ae6f63",
    "crtk_msgs/SetpointMode": "45488f3061f396e81b1a70a7e6acdfa4",
    "crtk_msgs/JointServo": "660a5227424e1ddeb4a13710d9166974",
    "crtk_msgs/CartesianState": "3913bf7ef8bcc8fa7a8eb33a46f273db",
    "crtk_msgs/OperatingState": "b1bd4021639d9d9c5fbfff78d6ff3158",
    "crtk_msgs/operating_state": "b1bd4021639d9d9c5fbfff78d6ff3158",
    "crtk_msgs/StringStamped": "5e3e46086181199270f1ac3a28a5977f",
    "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "geometry_msgs/TransformStamped": "b5764a33bfeb3588febc2682852579b0",
    "std_msgs/Header": "2176decaecbce78abc3b96ef049fabed",
    "std_msgs/String": "992ce8a1687cec8c8bd883ec73ca41d1",
    "std_msgs/Bool": "8b94c1b53db61fb6aed406028ad6332a",
    "std_msgs/Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "sensor_msgs/Joy": "5a9ea5f83505693b71e785041e67a8bb",
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "geometry_msgs/TwistStamped": "98d34b0043a2093cf9d9345ab6eef12e",
    "geometry_msgs/WrenchStamped": "d78d3cb249ce23087ade7e7d0c40cfa7",
    "geometry_msgs/AccelStamped": "d8a98a5d81351b6eb0578c78557e7659",
    "geometry_msgs/Vector3Stamped": "7b324c7325e683bf02a9b14b01090ec7",
}


@pytest.mark.parametrize(("name", "md5"), PUBLISHED.items())
def test_md5_sum_is_the_published_one(name: str, md5: str) -> None:
    assert messages.md5_sum(name) == md5


def test_md5_sum_of_a_service_is_the_published_one_and_unknown_types_are_refused_with_the_choices() -> None:
    assert messages.service_md5_sum("std_srvs/Trigger") == "937c9679a518e3a18d831e57125ea522"
    with pytest.raises(FileFormatError, match="std_srvs/Trigger"):
        messages.service_md5_sum("std_srvs/Mood")
    with pytest.raises(FileFormatError, match="raven_state"):
        messages.md5_sum("raven_2/raven_mood")


def test_raven_state_has_964_bytes_after_its_header() -> None:
    message = blank_messages("raven_2/raven_state", 1, {}, {})
    header = 4 + 8 + 4  # seq, stamp, length of an empty frame
    assert message.dtype.itemsize == header + 964
    assert message.dtype.fields["runlevel"][1] == header


def _joint_state(rng: np.random.Generator, joints: int, frame: str) -> bytes:
    """One JointState without velocities, written by rosbags."""
    store, names = messages.typestore(1), [f"joint{'x' * i}" for i in range(joints)]
    head = header(store, int(rng.integers(2**31)) * 10**9 + 7, ros1=True)
    head.frame_id = frame
    message = joint_state(names, rng.normal(size=joints), (), rng.normal(size=joints))(store, head)
    return bytes(store.serialize_ros1(message, JOINT_STATE))


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
def test_joint_states_of_all_shapes_read_as_rosbags_reads_them(encoding: str) -> None:
    rng = np.random.default_rng(3)
    raw = [_joint_state(rng, joints, frame) for joints in (3, 0, 7, 3, 1, 7) for frame in ("", "a", "base")]
    store, name = messages.typestore(1 if encoding == "ros1" else 2), "sensor_msgs/msg/JointState"
    if encoding == "cdr":
        raw = [bytes(store.ros1_to_cdr(message, name)) for message in raw]
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    seen = []
    for where, records in read_messages("sensor_msgs/JointState", raw, encoding):
        for row, record in zip(where, records, strict=True):
            expected = read(raw[row], name)
            np.testing.assert_array_equal(record["position"], expected.position)
            np.testing.assert_array_equal(record["effort"], expected.effort)
            assert record["header.stamp.sec"] == expected.header.stamp.sec
            assert record["header.stamp.nsec"] == expected.header.stamp.nanosec
            seen.append(int(row))
    assert sorted(seen) == list(range(len(raw)))


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("name", messages.MESSAGES)
def test_numbers_written_by_field_are_what_rosbags_reads(name: str, encoding: str) -> None:
    rng = np.random.default_rng(4)
    message = blank_messages(name, 1, {"header.frame_id": "b"} if "Stamped" in name else {}, {})
    for path in message.dtype.names or ():
        if not path.startswith("#") and message[path].dtype.kind in "iuf":
            message[path] = rng.integers(0, 2 if message[path].dtype.itemsize == 1 else 100, message[path].shape)
    raw = message.tobytes()
    if encoding == "cdr":
        raw = bytes(messages.typestore(2).ros1_to_cdr(raw, messages.ros2_name(name)))
    read = messages.typestore(1).deserialize_ros1 if encoding == "ros1" else messages.typestore(2).deserialize_cdr
    expected = read(raw, messages.ros2_name(name))
    ((_, records),) = read_messages(name, [raw], encoding)
    for path in records.dtype.names or ():
        value = expected
        for part in path.lstrip("#").replace("nsec", "nanosec").split("."):
            value = value[int(part)] if part.isdigit() else getattr(value, part)
        if path.startswith("#") or isinstance(value, str):
            continue
        np.testing.assert_array_equal(records[path][0], value, err_msg=path)


RAVEN_STATE = blank_messages("raven_2/raven_state", 1, {}, {}).tobytes()


@pytest.mark.parametrize(
    ("name", "raw", "encoding", "message"),
    [
        *[("raven_2/raven_state", RAVEN_STATE[:cut], "ros1", "bytes") for cut in (1, 20, 500, 979)],
        ("raven_2/raven_state", RAVEN_STATE + b"\0", "ros1", "expected 980 bytes"),
        ("std_msgs/String", b"\xff\xff\xff\xff", "ros1", "claims"),
        ("std_msgs/String", b"\0\0\0\0\0\0\0\1\0", "cdr", "little-endian"),
    ],
)
def test_bytes_that_are_no_such_message_are_refused(name, raw, encoding, message) -> None:
    with pytest.raises(FileFormatError, match=message):
        layout_of(name, raw, encoding)


TIME = 0.033 * np.arange(20)
STAMP = np.rint(TIME * 1e9).astype(np.int64) + 1_700_000_000_123_456_789
COLUMNS = telemetry(TIME, np.random.default_rng(0))


def published(columns: dict[str, np.ndarray]) -> list[Any]:
    """The messages of a RAVEN's state, as rosbags reads them."""
    return [
        messages.typestore(1).deserialize_ros1(raw.tobytes(), "raven_2/msg/raven_state")
        for raw in encode(RAVENSTATE, STAMP, columns)
    ]


def test_numbers_are_published_as_the_robot_does() -> None:
    for row, message in enumerate(published(COLUMNS)):
        for name in ("jpos", "jvel", "mpos", "mvel", "jpos_d", "mpos_d"):  # degrees, metres of insertion too
            # rtol: float32
            assert_allclose(getattr(message, name), COLUMNS[name][row] * 180.0 / np.pi, rtol=1e-7)
        assert_array_equal(message.pos, np.rint(COLUMNS["pos"][row] * 1e6))  # whole micrometres
        assert_allclose(message.tau, COLUMNS["tau"][row], rtol=1e-7)
        assert_array_equal(message.encVals, COLUMNS["encVals"][row])
        stamp = message.hdr.stamp
        assert (stamp.sec * 10**9 + stamp.nanosec, message.hdr.seq) == (STAMP[row], row)


@pytest.mark.parametrize(
    ("stamp", "columns", "message"),
    [
        (STAMP, {}, "lacks tau, jpos"),
        *[(STAMP, COLUMNS | {"encVals": np.full((20, 16), value)}, "encVals") for value in (np.nan, 3e9)],
        (STAMP - STAMP[0] - 1, COLUMNS, "does not fit"),
    ],
    ids=["columns that lack", "no count", "too large a count", "before the epoch"],
)
def test_what_no_message_can_hold_is_refused(stamp: Any, columns: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        encode(RAVENSTATE, stamp, columns)


def test_what_is_not_required_is_published_as_zero() -> None:
    for message in published({name: COLUMNS[name] for name in ("jpos", "tau")}):
        assert not message.encVals.any()


def test_an_angle_that_is_not_a_number_is_published_as_such() -> None:
    jpos = COLUMNS["jpos"].copy()
    jpos[3, 2] = np.nan
    assert np.isnan([message.jpos for message in published(COLUMNS | {"jpos": jpos})]).sum() == 1
