import numpy as np
import pytest

from catenary.monitor.snapshot import EventRate, Snapshot
from catenary.plant import OperatingState

FINE = Snapshot(
    1.0, ("a", "b"), ("rad", "m"), np.array([0.5, 0.1]), np.array([0.5, 0.1]), gravity=np.array([0.0, 0.0, -9.81]),
    gravity_age=0.01, operating=OperatingState("ENABLED", True, False), lower=np.array([0.0, 0.0]),
    upper=np.array([1.0, 0.2]), rate_hz=1000.0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, None),
        ({"gravity_age": np.inf}, None),  # nominal gravity is not stale
        ({"q": np.array([0.99, 0.1])}, "near a limit: a"),
        ({"q": np.array([0.5, 0.197])}, "near a limit: b"),
        ({"gravity_age": 0.5}, "gravity is 0.50 s old"),
        ({"operating": OperatingState("FAULT", True, False)}, "FAULT: it does not say why"),
        ({"operating": OperatingState("FAULT", True, False), "fault": "a cable"}, "FAULT: a cable"),
        ({"operating": OperatingState("DISABLED", False, False)}, "not homed"),
        ({"inside": np.array([True, False])}, "valid range: b"),
        ({"late": 3}, "3 ticks of this program late"),
        ({"silent": "nothing has come for 0.4 s"}, "stale: nothing"),
    ],
)
def test_what_is_wrong_is_said_and_nothing_else(change: dict[str, object], words: str | None) -> None:
    found = FINE._replace(**change).warnings()
    assert len(found) == (words is not None)
    assert all(words in warning for warning in found if words)


def test_rate_is_that_of_the_last_second() -> None:
    rate = EventRate()
    for k in range(200):
        rate.count(0.1 * k if k < 100 else 9.9 + 0.01 * (k - 99))
    assert rate.hertz(9.9 + 0.01 * 100) == pytest.approx(100.0)
    assert rate.hertz(20.0) is None
