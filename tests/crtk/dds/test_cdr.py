"""CDR against rosbags, which writes it another way."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.codec import codec
from catenary.crtk.dds.cdr import cdr_decoder, cdr_encoder
from catenary.crtk.message import header, message_class
from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import MESSAGES, SERVICES, ros2_name, typestore
from oracles.random_messages import assert_same, random_message

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
HALVES = [f"{service}{half}" for service in SERVICES for half in ("Request", "Response")]


def without_seq(name: str, message: Any) -> Any:
    """The message with 0 in its headers."""
    return codec(name).decode(bytes(typestore(2).cdr_to_ros1(cdr_encoder(name)(message), ros2_name(name))))


@pytest.mark.parametrize("name", MESSAGES)
def test_bytes_are_those_of_rosbags_and_are_read_back(name: str) -> None:
    rng = np.random.default_rng(7)
    for _ in range(25):
        message = random_message(name, rng)
        data = cdr_encoder(name)(message)
        assert data == bytes(typestore(2).ros1_to_cdr(codec(name).encode(message, 0), ros2_name(name)))
        if ros2_name(name) in HUMBLE.fielddefs:
            known = HUMBLE.deserialize_cdr(data, ros2_name(name))
            assert bytes(HUMBLE.serialize_cdr(known, ros2_name(name))) == data
        assert_same(cdr_decoder(name)(data), without_seq(name, message))


@pytest.mark.parametrize("name", HALVES)
def test_halves_of_services_have_bytes_of_rosbags(name: str) -> None:
    rng = np.random.default_rng(1)
    for message in (message_class(name)(), *(random_message(name, rng) for _ in range(5))):
        data = bytes(typestore(2).ros1_to_cdr(codec(name).encode(message, 0), ros2_name(name)))
        assert cdr_encoder(name)(message) == data


@pytest.mark.parametrize("length", range(9))
def test_numbers_stand_at_multiples_of_their_size_behind_texts_of_any_length(length: int) -> None:
    message = message_class("sensor_msgs/JointState")(
        header(1, "f" * length), ("n" * length, "m"), np.arange(3.0), (), np.ones(1)
    )
    data = cdr_encoder("sensor_msgs/JointState")(message)
    assert (data.index(np.arange(3.0).tobytes()[8:]) - 4) % 8 == 0
    assert_same(cdr_decoder("sensor_msgs/JointState")(data), without_seq("sensor_msgs/JointState", message))


@pytest.mark.parametrize(
    ("message", "complaint"),
    [
        (message_class("sensor_msgs/JointState")(position=["a"]), "position"),
        (message_class("sensor_msgs/JointState")(name="shoulder"), "name: .*single text"),
        (message_class("crtk_msgs/StringStamped")(header=5), "header"),
        (message_class("std_msgs/Bool")(), "expected a message sensor_msgs/JointState"),
    ],
)
def test_what_does_not_fit_is_refused_by_its_field(message: Any, complaint: str) -> None:
    name = "crtk_msgs/StringStamped" if hasattr(message, "string") else "sensor_msgs/JointState"
    with pytest.raises(InputError, match=complaint):
        cdr_encoder(name)(message)


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 20])
def test_bytes_that_are_no_message_are_refused(data: bytes) -> None:
    with pytest.raises(FileFormatError, match="bytes are no such message"):
        cdr_decoder("sensor_msgs/JointState")(data)
