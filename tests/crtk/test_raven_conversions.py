import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.codec import codec
from catenary.crtk.message import message_class
from catenary.crtk.raven_conversions import arm_channels, raven_state_columns, raven_state_message
from catenary.errors import InputError
from catenary.recording.topics import RAVENSTATE, decode

STATE = "raven_2/raven_state"


def columns(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """All fields, whole numbers where the message has such."""
    return {
        column.name: rng.integers(-1000, 1000, column.width).astype(float)
        * (1e-6 if column.to_si == 1e-6 else 1.0)
        for column in RAVENSTATE.columns
    }


def test_positions_and_velocities_are_sent_times_180_over_pi_also_metres() -> None:
    message = raven_state_message({"jpos": np.full(16, np.pi), "mvel": np.full(16, np.pi / 2)}, 1)
    assert_allclose(message.jpos, 180.0)  # channel 2 is the insertion: metres
    assert_allclose(message.mvel, 90.0)


def test_torques_are_sent_as_they_are_and_tips_in_micrometres() -> None:
    message = raven_state_message({"tau": np.full(16, 0.5), "pos": np.full(6, 0.0123456)}, 1)
    assert_allclose(message.tau, 0.5)
    assert message.pos.tolist() == [12346] * 6


def test_all_fields_survive_the_wire_and_the_way_back_in_single_precision() -> None:
    sent = columns(np.random.default_rng(1))
    one = codec(STATE)
    got = raven_state_columns(one.decode(one.encode(raven_state_message(sent, 7), 1)))
    assert sent.keys() == got.keys()
    for name, values in sent.items():
        assert_allclose(got[name], values, rtol=1e-6, err_msg=name)  # float32


def test_recordings_read_the_same_from_the_bytes() -> None:
    sent = columns(np.random.default_rng(2))
    data = codec(STATE).encode(raven_state_message(sent, 1_500_000_000_000_000_007), 1)
    read = decode(RAVENSTATE, [data])
    assert read.stamp[0] == 1_500_000_000_000_000_007
    for name, values in sent.items():
        assert_allclose(read.columns[name][0], values, rtol=1e-6, err_msg=name)  # float32


def test_arms_have_eight_channels_each_of_which_one_is_unused() -> None:
    assert_array_equal(arm_channels(np.arange(16.0), "gold"), [0, 1, 2, 4, 5, 6, 7])
    assert_array_equal(arm_channels(np.arange(16.0), "green"), [8, 9, 10, 12, 13, 14, 15])
    with pytest.raises(InputError, match="gold or green"):
        arm_channels(np.arange(16.0), "blue")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"mood": np.zeros(1)}, 'no field "mood"; there are runlevel'),
        ({"jpos": np.zeros(7)}, r"raven_state\.jpos: expected shape \(16,\)"),
        ({"jpos": np.full(16, np.nan)}, "is nan"),
        ({"pos": np.full(6, 1e4)}, "does not fit into 32 bits"),
    ],
)
def test_what_no_field_can_hold_is_refused(given: dict[str, np.ndarray], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        raven_state_message(given, 1)


def test_what_is_not_given_is_zero() -> None:
    message = raven_state_message({}, 5)
    assert isinstance(message, message_class(STATE))
    assert all(not np.any(values) for values in raven_state_columns(message).values())
