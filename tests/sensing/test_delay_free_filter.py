import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.sensing.delay_free_filter import CUTOFF_BY_WINDOW, DelayFreeFilter


def filled(values, stamps, cutoff_hz):
    fit = DelayFreeFilter(cutoff_hz)
    for t, v in zip(stamps, values, strict=True):
        fit.add(t, v)
    return fit


@pytest.mark.parametrize("window", [0.03, 0.06])
def test_it_is_the_least_squares_parabola_of_the_window(window, rng):
    stamps, values = np.cumsum(rng.uniform(0.003, 0.007, 50)), rng.normal(size=(50, 3))
    fit = filled(values, stamps, CUTOFF_BY_WINDOW / window)
    inside = stamps >= stamps[-1] - window - 1e-6
    expected = [np.polyfit(stamps[inside], values[inside, axis], 2) for axis in range(3)]
    now = stamps[-1] + 0.002
    assert_allclose(fit.at(now)[0], [np.polyval(p, now) for p in expected], atol=1e-8)
    assert_allclose(fit.at(now)[1], [np.polyval(np.polyder(p), now) for p in expected], atol=1e-6)


def response(window, w):
    """Value and derivative at the end of exp(i w t), with nearly as many samples as there is room for."""
    stamps = np.arange(-127, 1) * window / 127.0
    fits = [filled(f(w * stamps)[:, None] * np.ones(3), stamps, CUTOFF_BY_WINDOW / window) for f in (np.cos, np.sin)]
    real, imaginary = (fit.at(0.0)[:, 0] for fit in fits)
    return real + 1j * imaginary


@pytest.mark.parametrize(("x", "gain", "phase", "slope", "slope_phase"), [
    (0.05, 1.0000, 0.015, 1.010, -0.07), (0.1, 1.0005, 0.11, 1.038, -0.5), (0.2, 1.008, 0.8, 1.139, -3.6),
])  # fmt: skip
def test_the_response_to_a_sine_is_as_documented(x, gain, phase, slope, slope_phase):
    w = 2.0 * np.pi * x / 0.05
    value, derivative = response(0.05, w)
    # the edges of a sum weigh more than those of an integral, by 1/127
    assert abs(value) == pytest.approx(gain, abs=1e-3)
    assert np.degrees(np.angle(value)) == pytest.approx(phase, abs=0.05)
    assert abs(derivative / (1j * w)) == pytest.approx(slope, abs=3e-3)
    assert np.degrees(np.angle(derivative / (1j * w))) == pytest.approx(slope_phase, abs=0.2)


def test_half_power_is_at_the_cutoff():
    value, _ = response(CUTOFF_BY_WINDOW / 40.0, 2.0 * np.pi * 40.0)
    # a sum's edges weigh more than an integral's, nine times 1/127 and half
    assert abs(value) == pytest.approx(np.sqrt(0.5), abs=0.05)


def test_noise_comes_out_as_documented(rng):
    out = []
    for _ in range(400):
        stamps = np.arange(20) * 0.005
        fit = filled(rng.normal(size=(20, 3)), stamps, CUTOFF_BY_WINDOW / 0.0951)
        out.append(fit.at(stamps[-1]))
    value, derivative = np.std(out, axis=(0, 2))
    assert value == pytest.approx(3.0 / np.sqrt(20), rel=0.2)
    assert derivative == pytest.approx(14.0 / (0.095 * np.sqrt(20)), rel=0.2)


def test_few_samples_are_a_mean_and_not_a_wild_parabola():
    fit = filled([[1.0, 2.0, 3.0], [1.2, 2.0, 3.0]], [0.0, 0.005], 50.0)
    value, derivative = fit.at(1.0)
    assert_allclose(value, [1.1, 2.0, 3.0])
    assert_allclose(derivative, 0.0)


def test_nothing_is_zero_and_stays_a_number():
    fit = DelayFreeFilter(50.0)
    assert_allclose(fit.at(5.0), 0.0)
    fit.add(1.0, np.ones(3))
    fit.clear()
    assert_allclose(fit.at(5.0), 0.0)


@pytest.mark.parametrize("cutoff", [0.0, -1.0, np.nan, np.inf])
def test_cutoffs_that_are_none_are_refused(cutoff):
    with pytest.raises(InputError, match="cutoff_hz"):
        DelayFreeFilter(cutoff)
