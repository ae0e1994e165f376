import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.message import message_class
from catenary.raven2.topics import CHANNELS, RAVEN_TOPICS, RAVENSTATE, in_channels, raven_topics, state_column
from catenary.recording.layout import topic_named

STATE = "raven_2/raven_state"


def column(field: str, sent: object) -> np.ndarray:
    return state_column(message_class(STATE)(**{field: sent}), field)


@pytest.mark.parametrize(
    ("field", "sent", "si"),
    [
        ("jpos", 180.0, np.pi),  # channel 2 is the insertion: metres, multiplied by 180/pi like the angles
        ("mvel", 90.0, np.pi / 2),
        ("tau", 0.5, 0.5),
        ("pos", 12346, 0.012346),  # um
        ("encVals", -7, -7.0),
    ],
)
def test_numbers_in_the_robots_units_become_si(field: str, sent: float, si: float) -> None:
    width = len(getattr(message_class(STATE)(), field))
    assert_allclose(column(field, np.full(width, sent)), np.full(width, si))


def test_single_numbers_are_columns_of_one_and_the_duration_is_in_seconds() -> None:
    assert_array_equal(column("runlevel", 3), [3.0])
    assert_array_equal(column("dt", 1_500_000), [0.0015])


def test_an_arm_has_eight_channels_of_which_one_is_unused_and_the_other_arms_are_zero() -> None:
    for arm, first in (("gold", 0), ("green", 8)):
        channels = in_channels(arm, np.arange(1.0, 8.0))
        assert_array_equal(channels[first : first + 8], [1, 2, 3, 0, 4, 5, 6, 7])
        assert_array_equal(channels[list(CHANNELS[arm])], np.arange(1.0, 8.0))
        assert channels.sum() == 28.0


def test_insertion_is_in_metres_and_other_joints_in_radians() -> None:
    for topic in RAVEN_TOPICS:
        for one in topic.columns:
            for label, unit in zip(one.labels, one.units, strict=True):
                if one.name in ("jpos", "jpos_d", "measured_js", "ext_jpos") and "unused" not in label:
                    assert unit == ("m" if label.endswith("insertion") else "rad"), label


def test_measured_js_is_swapped_on_the_robot() -> None:
    assert raven_topics("gold")[1].name == "/arm2/measured_js"
    assert raven_topics("green")[1].name == "/arm1/measured_js"


def test_state_at_100_hz_has_its_own_topic_without_a_slash() -> None:
    assert raven_topics(state_rate=100.0)[0].name == "ravenstate_100hz"
    assert topic_named("/ravenstate_100hz") is not None
    assert topic_named("ravenstate") is RAVENSTATE
