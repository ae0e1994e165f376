import math

import numpy as np
import pytest

from catenary.errors import InputError
from catenary.sensing.cutoff import cutoff_errors, recommended_cutoff
from catenary.sensing.delay_free_filter import DelayFreeFilter

SHIP = {"angle": 0.14, "frequency": 0.14, "noise": 0.04, "rate_noise": 8.7e-4, "rate_hz": 200.0}


@pytest.mark.parametrize("cutoff", [5.0, 35.0])
@pytest.mark.parametrize(("angle", "frequency"), [(0.14, 0.14), (0.1, 1.0)])
def test_errors_are_those_that_a_filter_makes_of_noisy_samples(cutoff, angle, frequency):
    rng, w = np.random.default_rng(2), 2.0 * math.pi * frequency
    level, turning, off = DelayFreeFilter(cutoff), DelayFreeFilter(cutoff), []
    for t in np.arange(0.0, 8.0, 0.005):
        level.add(t, [9.81 * angle * math.sin(w * t), 0.0, 0.0] + 0.04 * rng.normal(size=3))
        turning.add(t, [angle * w * math.cos(w * t), 0.0, 0.0] + 8.7e-4 * rng.normal(size=3))
        if t > 1.0:
            gravity = level.at(t)[0] - [9.81 * angle * math.sin(w * t), 0.0, 0.0]
            alpha = turning.at(t)[1] + [angle * w * w * math.sin(w * t), 0.0, 0.0]
            off.append([gravity @ gravity, alpha @ alpha])
    measured = np.sqrt(np.mean(off, axis=0))
    told = cutoff_errors(cutoff, **{**SHIP, "angle": angle, "frequency": frequency})
    assert [told.gravity, told.angular] == pytest.approx(measured, rel=0.2)  # errors of neighbours are alike


def test_noisier_units_want_lower_cut_offs_and_faster_bases_higher_ones():
    calm = recommended_cutoff(**SHIP)
    assert recommended_cutoff(**{**SHIP, "noise": 0.4, "rate_noise": 8.7e-3}).cutoff_hz < calm.cutoff_hz
    assert recommended_cutoff(**{**SHIP, "frequency": 1.0}).cutoff_hz > calm.cutoff_hz


def test_angular_terms_help_on_a_ship_at_a_low_cut_off_only():
    assert recommended_cutoff(**SHIP).angular_helps
    assert cutoff_errors(5.0, **SHIP).angular_helps
    assert not cutoff_errors(50.0, **SHIP).angular_helps


@pytest.mark.parametrize(
    "wrong", [{"noise": -1.0}, {"frequency": 0.0}, {"rate_hz": 1.0}, {"angle": math.nan}]
)
def test_numbers_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError, match="cut-off"):
        recommended_cutoff(**{**SHIP, **wrong})
