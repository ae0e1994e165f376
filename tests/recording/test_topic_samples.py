from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.raven2.topics import RAVENSTATE
from catenary.recording.messages import typestore
from catenary.recording.topic_samples import encode
from oracles.raven_recording import telemetry

TIME = 0.033 * np.arange(20)
STAMP = np.rint(TIME * 1e9).astype(np.int64) + 1_700_000_000_123_456_789
COLUMNS = telemetry(TIME, np.random.default_rng(0))


def published(columns: dict[str, np.ndarray]) -> list[Any]:
    """The messages of a RAVEN's state, as rosbags reads them."""
    return [
        typestore(1).deserialize_ros1(raw.tobytes(), "raven_2/msg/raven_state")
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
