import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.recording.layout import blank_messages
from catenary.recording.messages import typestore
from catenary.recording.topics import (
    EXT_JPOS,
    GOLD_MEASURED_JS,
    RAVENSTATE,
    TOPICS,
    decode,
    encode,
    raven_topics,
    topic_named,
    wrong_type,
)
from oracles.raven_recording import telemetry

TIME = 0.033 * np.arange(20)
STAMP = np.rint(TIME * 1e9).astype(np.int64) + 1_700_000_000_123_456_789


def _published() -> list[object]:
    messages = encode(RAVENSTATE, STAMP, telemetry(TIME, np.random.default_rng(0)))
    return [typestore(1).deserialize_ros1(m.tobytes(), "raven_2/msg/raven_state") for m in messages]


def test_positions_and_velocities_are_published_times_180_over_pi_metres_too() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    for row, message in enumerate(_published()):
        for name in ("jpos", "jvel", "mpos", "mvel", "jpos_d", "mpos_d"):
            # rtol: float32
            assert_allclose(getattr(message, name), columns[name][row] * 180.0 / np.pi, rtol=1e-7)


def test_tip_positions_are_published_in_whole_micrometres() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    for row, message in enumerate(_published()):
        assert_array_equal(message.pos, np.rint(columns["pos"][row] * 1e6))  # type: ignore[attr-defined]


def test_torque_and_counts_are_published_as_they_are() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    for row, message in enumerate(_published()):
        assert_allclose(message.tau, columns["tau"][row], rtol=1e-7)  # type: ignore[attr-defined]  # float32
        assert_array_equal(message.encVals, columns["encVals"][row])  # type: ignore[attr-defined]


def test_header_carries_the_stamp_and_counts_messages() -> None:
    for row, message in enumerate(_published()):
        stamp = message.hdr.stamp  # type: ignore[attr-defined]
        assert stamp.sec * 10**9 + stamp.nanosec == STAMP[row]
        assert message.hdr.seq == row  # type: ignore[attr-defined]


def test_what_is_decoded_is_what_was_encoded() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    for topic in raven_topics():
        messages = [m.tobytes() for m in encode(topic, STAMP, columns)]
        samples = decode(topic, messages)
        assert_array_equal(samples.stamp, STAMP)
        for column in topic.columns:
            if column.name in columns:
                # atol: micrometres rounded; rtol: float32
                assert_allclose(
                    samples.columns[column.name],
                    columns[column.name],
                    rtol=1e-6,
                    atol=6e-7,
                    err_msg=column.name,
                )
            else:
                assert np.isnan(samples.columns[column.name]).all()


def test_insertion_is_in_metres_and_other_joints_in_radians() -> None:
    for topic in TOPICS:
        for column in topic.columns:
            for name, unit in zip(column.names, column.units, strict=True):
                if column.name in ("jpos", "jpos_d", "measured_js", "ext_jpos") and "unused" not in name:
                    assert unit == ("m" if name.endswith("insertion") else "rad"), name


def test_measured_js_is_swapped_on_the_robot() -> None:
    assert raven_topics("gold")[1].name == "/arm2/measured_js"
    assert raven_topics("green")[1].name == "/arm1/measured_js"


def test_state_at_100_hz_has_its_own_topic_without_a_slash() -> None:
    assert raven_topics(state_rate=100.0)[0].name == "ravenstate_100hz"
    assert topic_named("/ravenstate_100hz") is not None
    assert topic_named("ravenstate") is RAVENSTATE


def test_missing_columns_are_named() -> None:
    with pytest.raises(InputError, match="lacks tau, jpos"):
        encode(RAVENSTATE, STAMP, {})


def test_what_is_not_required_is_published_as_zero() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    samples = decode(
        RAVENSTATE,
        [m.tobytes() for m in encode(RAVENSTATE, STAMP, {k: columns[k] for k in ("jpos", "tau")})],
    )
    assert not samples.columns["encVals"].any()


@pytest.mark.parametrize("value", [np.nan, 3e9])
def test_a_count_that_does_not_fit_is_refused(value: float) -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    columns["encVals"][3, 2] = value
    with pytest.raises(InputError, match="encVals"):
        encode(RAVENSTATE, STAMP, columns)


def test_an_angle_that_is_not_a_number_is_published_as_such() -> None:
    columns = telemetry(TIME, np.random.default_rng(0))
    columns["jpos"][3, 2] = np.nan
    samples = decode(RAVENSTATE, [m.tobytes() for m in encode(RAVENSTATE, STAMP, columns)])
    assert np.isnan(samples.columns["jpos"]).sum() == 1


def test_a_stamp_before_the_epoch_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit"):
        encode(EXT_JPOS, np.array([-1]), {"ext_jpos": np.zeros((1, 3))})


def test_another_number_of_joints_is_refused() -> None:
    message = blank_messages("sensor_msgs/JointState", 1, {}, {"position": 4}).tobytes()
    with pytest.raises(FileFormatError, match="4 numbers, expected 3"):
        decode(EXT_JPOS, [message])


def test_joints_in_another_order_are_refused() -> None:
    names = {"name.0": "elbow", "name.1": "shoulder", "name.2": "insertion"}
    message = blank_messages("sensor_msgs/JointState", 1, names, {"position": 3, "name": 3}).tobytes()
    with pytest.raises(FileFormatError, match="elbow, shoulder"):
        decode(EXT_JPOS, [message])


def test_another_type_on_a_topic_is_named() -> None:
    assert wrong_type(GOLD_MEASURED_JS, "sensor_msgs/msg/JointState") is None
    assert "expected sensor_msgs/JointState" in str(wrong_type(GOLD_MEASURED_JS, "std_msgs/String"))
