import numpy as np
import pytest

from catenary.control.realtime import Durations


def test_quantiles_are_those_of_the_durations_to_one_per_cent() -> None:
    values = np.random.default_rng(0).lognormal(mean=-11.0, sigma=1.0, size=20_000)
    durations = Durations()
    for value in values:
        durations.add(float(value))
    timing = durations.timing()
    assert timing is not None
    # rank to the next sample, which lies within a per cent of the exact one here
    assert timing.median == pytest.approx(float(np.quantile(values, 0.5)), rel=0.011)
    assert timing.p99 == pytest.approx(float(np.quantile(values, 0.99)), rel=0.03)
    assert timing.p999 == pytest.approx(float(np.quantile(values, 0.999)), rel=0.05)
    assert timing.max == values.max()
