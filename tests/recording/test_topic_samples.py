from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.raven2.topics import EXT_JPOS, RAVENSTATE, raven_topics
from catenary.recording.layout import blank_messages
from catenary.recording.messages import typestore
from catenary.recording.topic_samples import TopicSamples, decode, encode
from catenary.topics import Topic
from oracles.raven_recording import telemetry

TIME = 0.033 * np.arange(20)
STAMP = np.rint(TIME * 1e9).astype(np.int64) + 1_700_000_000_123_456_789
COLUMNS = telemetry(TIME, np.random.default_rng(0))


def published(columns: dict[str, np.ndarray], topic: Topic = RAVENSTATE) -> TopicSamples:
    """What a reader makes of a topic that was published from these columns."""
    return decode(topic, [message.tobytes() for message in encode(topic, STAMP, columns)])


def test_numbers_are_published_as_the_robot_does() -> None:
    for row, raw in enumerate(encode(RAVENSTATE, STAMP, COLUMNS)):
        message = typestore(1).deserialize_ros1(raw.tobytes(), "raven_2/msg/raven_state")
        for name in ("jpos", "jvel", "mpos", "mvel", "jpos_d", "mpos_d"):  # degrees, metres of insertion too
            # rtol: float32
            assert_allclose(getattr(message, name), COLUMNS[name][row] * 180.0 / np.pi, rtol=1e-7)
        assert_array_equal(message.pos, np.rint(COLUMNS["pos"][row] * 1e6))  # whole micrometres
        assert_allclose(message.tau, COLUMNS["tau"][row], rtol=1e-7)
        assert_array_equal(message.encVals, COLUMNS["encVals"][row])
        stamp = message.hdr.stamp
        assert (stamp.sec * 10**9 + stamp.nanosec, message.hdr.seq) == (STAMP[row], row)


def test_what_is_decoded_is_what_was_encoded() -> None:
    for topic in raven_topics():
        samples = published(COLUMNS, topic)
        assert_array_equal(samples.stamp, STAMP)
        for column in topic.columns:
            # what was not given comes back as NaN; atol: micrometres rounded; rtol: float32
            expected = COLUMNS.get(column.name, np.full((len(STAMP), column.width), np.nan))
            assert_allclose(samples.columns[column.name], expected, rtol=1e-6, atol=6e-7, err_msg=column.name)


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
    samples = published({name: COLUMNS[name] for name in ("jpos", "tau")})
    assert not samples.columns["encVals"].any()


def test_an_angle_that_is_not_a_number_is_published_as_such() -> None:
    jpos = COLUMNS["jpos"].copy()
    jpos[3, 2] = np.nan
    samples = published(COLUMNS | {"jpos": jpos})
    assert np.isnan(samples.columns["jpos"]).sum() == 1


def test_another_number_of_joints_or_order_is_refused() -> None:
    message = blank_messages("sensor_msgs/JointState", 1, {}, {"position": 4}).tobytes()
    with pytest.raises(FileFormatError, match="4 numbers, expected 3"):
        decode(EXT_JPOS, [message])
    names = {"name.0": "elbow", "name.1": "shoulder", "name.2": "insertion"}
    message = blank_messages("sensor_msgs/JointState", 1, names, {"position": 3, "name": 3}).tobytes()
    with pytest.raises(FileFormatError, match="elbow, shoulder"):
        decode(EXT_JPOS, [message])
