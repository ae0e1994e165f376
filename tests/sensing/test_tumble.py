import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.sensing.gravity_vector import tilted_gravity
from catenary.sensing.tumble import align, fit_tumble, level_and_tilts

SIX = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
BIAS, SCALE = np.array([0.3, -0.2, 0.5]), np.array([1.02, 0.97, 1.01])


def spread(rng, count):
    """Directions about all six sides, by hand: 15 degrees off or so."""
    turns = Rotation.from_rotvec(0.25 * rng.normal(size=(count, 3)))
    return turns.apply(np.resize(SIX, (count, 3)))


def read(directions, *, bias=BIAS, scale=SCALE, noise=0.0, rng=None):
    readings = 9.81 * directions * scale + bias
    return readings if rng is None else readings + noise * rng.normal(size=readings.shape)


@settings(deadline=None)
@given(seed=st.integers(0, 200))
def test_bias_and_scale_are_found_whatever_the_attitudes(seed):
    rng = np.random.default_rng(seed)
    bias, scale = 0.5 * rng.normal(size=3), 1.0 + 0.03 * rng.normal(size=3)
    found = fit_tumble(read(spread(rng, 12), bias=bias, scale=scale))
    if found.missing:  # drawn too far off
        return
    assert not found.faults
    assert_allclose(found.bias, bias, atol=1e-6)
    assert_allclose(found.scale, scale, atol=1e-6)
    assert found.residual < 1e-6


def test_six_sides_are_enough_but_leave_no_residual():
    found = fit_tumble(read(SIX))
    assert_allclose(found.bias, BIAS, atol=1e-8)
    assert_allclose(found.scale, SCALE, atol=1e-8)
    assert np.isnan(found.residual)


def test_the_residual_is_the_noise_of_the_readings(rng):
    found = fit_tumble(read(spread(rng, 60), noise=0.02, rng=rng))
    assert found.residual == pytest.approx(0.02, rel=0.3)
    assert_allclose(found.bias, BIAS, atol=0.02)


def test_sides_that_never_were_up_are_named():
    found = fit_tumble(read(np.resize(SIX[:5], (8, 3))))
    assert found.missing == ("-z up",)
    assert found.faults == ("too little spread: no reading with -z up",)


@pytest.mark.parametrize(
    ("factor", "said"),
    [(1.0 / 9.80665, "in g,"), (100.0, "in cm/s2"), (1000.0 / 9.80665, "in mg"), (0.0, "removes gravity"), (2.0, "length 19.6")],
)  # fmt: skip
def test_readings_in_another_unit_are_told(factor, said):
    assert said in fit_tumble(read(SIX, bias=0.0, scale=factor)).faults[0]


def test_a_sensor_that_was_moved_is_told(rng):
    faults = fit_tumble(read(spread(rng, 20), noise=0.5, rng=rng)).faults
    assert any("moved during a reading" in fault for fault in faults)


def test_fewer_than_six_readings_are_refused():
    with pytest.raises(InputError, match="at least 6 readings"):
        fit_tumble(SIX[:5])


@given(seed=st.integers(0, 200))
def test_the_rotation_is_found_from_attitudes_that_are_known(seed):
    rng = np.random.default_rng(seed)
    R_base_imu = Rotation.random(rng=rng).as_matrix()
    up = spread(rng, 6)
    found = align(9.81 * up @ R_base_imu, up, expected=R_base_imu)
    assert not found.faults
    assert_allclose(found.rotation, R_base_imu, atol=1e-9)
    assert found.residual_deg < 1e-6


def test_the_residual_of_a_rotation_is_how_far_off_the_attitudes_were(rng):
    up = spread(rng, 200)
    told = Rotation.from_rotvec(np.radians(2.0) * rng.normal(size=(200, 3))).apply(up)
    # two of the three axes of a random turn move a direction
    assert align(9.81 * up, told).residual_deg == pytest.approx(2.0 * np.sqrt(2.0), rel=0.1)


@pytest.mark.parametrize("readings", [SIX, spread(np.random.default_rng(0), 9)])
def test_a_wrong_sign_is_told_from_a_wrong_order_of_axes(readings):
    assert "wrong sign" in align(-9.81 * readings, readings).faults[0]
    swapped = align(9.81 * readings[:, [1, 0, 2]], readings).faults[0]
    assert "wrong axes: x reads +y, y reads +x, z reads +z" in swapped
    flipped = align(9.81 * readings * [1.0, -1.0, 1.0], readings).faults[0]
    assert "wrong axes: x reads +x, y reads -y, z reads +z" in flipped
    cycled = align(9.81 * readings[:, [1, 2, 0]], readings, expected=np.eye(3)).faults[0]
    assert "wrong axes" in cycled
    assert "120 deg" in cycled


@given(seed=st.integers(0, 200), roll=st.floats(0.2, 1.2), pitch=st.floats(0.2, 1.2))
def test_a_level_base_and_tilts_that_nobody_measured_give_the_rotation(seed, roll, pitch):
    R_base_imu = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    rows = [-tilted_gravity(r, p) @ R_base_imu for r, p in ((0.0, 0.0), (roll, 0.0), (0.0, pitch))]
    readings, up = level_and_tilts(*rows)
    for count in (2, 3):
        found = align(readings[:count], up[:count], expected=R_base_imu)
        assert_allclose(found.rotation, R_base_imu, atol=1e-8)
        assert not found.faults


def test_level_and_two_tilts_show_a_wrong_sign_and_mirrored_axes():
    rows = [-tilted_gravity(r, p) for r, p in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))]
    readings, up = level_and_tilts(*[-r for r in rows])
    for count in (2, 3):  # one tilt is enough for the sign
        assert "wrong sign" in align(readings[:count], up[:count]).faults[0]
    assert "wrong axes" in align(*level_and_tilts(*[r[[1, 0, 2]] for r in rows])).faults[0]


def test_parallel_directions_are_refused():
    with pytest.raises(InputError, match="all directions are parallel"):
        align([[0, 0, 9.8], [0, 0, 9.8]], [[0, 0, 1], [0, 0, 1]])
