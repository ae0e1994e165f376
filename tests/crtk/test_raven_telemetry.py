import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_bytes import codec
from catenary.crtk.raven_telemetry import arm_channels, raven_state_columns
from catenary.errors import InputError
from catenary.recording.topics import RAVENSTATE, decode
from oracles.random_messages import random_message

STATE = "raven_2/raven_state"


def columns(**fields: object) -> dict[str, np.ndarray]:
    return raven_state_columns(message_class(STATE)(**fields))


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
    assert_allclose(columns(**{field: np.full(width, sent)})[field], np.full(width, si))


def test_single_numbers_are_columns_of_one_and_the_duration_is_in_seconds() -> None:
    got = columns(runlevel=3, dt=1_500_000)
    assert_array_equal(got["runlevel"], [3.0])
    assert_array_equal(got["dt"], [0.0015])


def test_recordings_read_the_same_from_the_bytes() -> None:
    sent: Message = random_message(STATE, np.random.default_rng(2))._replace(hdr=header(1_500_000_000_000_000_007))
    read = decode(RAVENSTATE, [codec(STATE).encode(sent, 1)])
    assert read.stamp[0] == 1_500_000_000_000_000_007
    for name, values in raven_state_columns(sent).items():
        assert_allclose(read.columns[name][0], values, rtol=1e-6, err_msg=name)  # float32


def test_arms_have_eight_channels_each_of_which_one_is_unused() -> None:
    assert_array_equal(arm_channels(np.arange(16.0), "gold"), [0, 1, 2, 4, 5, 6, 7])
    assert_array_equal(arm_channels(np.arange(16.0), "green"), [8, 9, 10, 12, 13, 14, 15])
    with pytest.raises(InputError, match="gold or green"):
        arm_channels(np.arange(16.0), "blue")  # type: ignore[arg-type]
