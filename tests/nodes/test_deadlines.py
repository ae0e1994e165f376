"""A model that takes longer than a tick is told so as a failure, not as a row of a table."""

import pytest

from catenary.control.realtime import Timing
from catenary.nodes.calibrated_topics import WireReport


def report(rate_hz: float | None, median: float | None) -> WireReport:
    latency = None if median is None else Timing(median, 2 * median, 3 * median, 4 * median)
    return WireReport(
        seconds=10.0, messages=100, published=100, rate_hz=rate_hz, latency=latency, late=0, missed=0, silences=0,
        longest_silence=0.0, not_homed=0, unreadable=0, stale=0, outside=(0.0,), joint_names=("a",), leaps={},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rate_hz", "median", "keeps_up"),
    [
        (1000.0, 0.9e-3, True),
        (1000.0, 3.4e-3, False),
        (30.0, 3.4e-3, True),
        (30.0, 0.04, False),
        (None, 0.04, True),
        (1000.0, None, True),
    ],
)
def test_what_is_corrected_after_the_next_message_has_come_does_not_keep_up(rate_hz, median, keeps_up) -> None:
    found = report(rate_hz, median)
    assert found.keeps_up is keeps_up
    assert found.as_data()["keeps_up"] is keeps_up
