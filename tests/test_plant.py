from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.plant import MotionLog
from recordings import recording

LOG = recording(np.random.default_rng(0), rows=6)


def changed(key: str, row: int, value: float) -> np.ndarray:
    values = getattr(LOG, key).copy()
    values[row] = value
    return values


def test_length_is_the_number_of_rows() -> None:
    assert len(LOG) == 6


def test_arrays_of_a_log_are_read_only_copies() -> None:
    q = LOG.q_nominal.copy()
    log = replace(LOG, q_nominal=q, signals={"current": np.zeros(6)})
    q[0] = 99.0
    assert log.q_nominal[0, 0] != 99.0
    for values in (log.q_nominal, log.q_encoder, log.time, log.ok, log.signals["current"]):
        assert not values.flags.writeable


@pytest.mark.parametrize("key", ["q_nominal", "time"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_non_finite_value_is_refused_with_its_row(key: str, value: float) -> None:
    with pytest.raises(InputError, match=rf'"run": {key} is -?(nan|inf) at row 4'):
        replace(LOG, **{key: changed(key, 4, value)})


@pytest.mark.parametrize("key", ["tau", "qd"])
def test_nan_in_a_further_quantity_is_refused_with_its_row(key: str) -> None:
    with pytest.raises(InputError, match=f"{key} is nan at row 2"):
        replace(LOG, **{key: changed("q_nominal", 2, np.nan)})


def test_nan_command_is_refused_even_without_a_measurement() -> None:
    with pytest.raises(InputError, match="q_nominal is nan at row 1"):
        replace(LOG, q_nominal=changed("q_nominal", 1, np.nan), ok=changed("ok", 1, False))


def test_nan_measurement_is_fine_where_ok_is_not_set() -> None:
    log = replace(LOG, q_encoder=changed("q_encoder", 1, np.nan), ok=changed("ok", 1, False))
    assert np.isnan(log.q_encoder[1]).all()


def test_nan_measurement_where_ok_is_set_is_refused_with_joint_and_row() -> None:
    q = LOG.q_encoder.copy()
    q[3, 1] = np.nan
    with pytest.raises(InputError, match="joint J2 is nan at row 3, where ok is set"):
        replace(LOG, q_encoder=q)


@pytest.mark.parametrize("key", ["q_encoder", "tau", "qd"])
def test_joint_array_of_another_shape_is_refused_by_name(key: str) -> None:
    with pytest.raises(InputError, match=rf"{key}: expected shape \(6, 3\), got \(6, 2\)"):
        replace(LOG, **{key: np.zeros((6, 2))})


@pytest.mark.parametrize("key", ["time", "ok"])
def test_column_of_another_length_is_refused_by_name(key: str) -> None:
    with pytest.raises(InputError, match=rf"{key}: expected shape \(6,\), got \(5,\)"):
        replace(LOG, **{key: getattr(LOG, key)[:5]})


def test_signal_of_another_length_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r'signal "current": expected shape \(6,\), got \(7,\)'):
        replace(LOG, signals={"current": np.zeros(7)})


@pytest.mark.parametrize("kind", [int, float])
def test_ok_of_numbers_is_refused(kind: type) -> None:
    with pytest.raises(InputError, match="ok: expected true or false"):
        replace(LOG, ok=np.ones(6, dtype=kind))


def test_empty_log_is_refused() -> None:
    with pytest.raises(InputError, match='"run": is empty'):
        MotionLog("run", ("J1",), ("rad",), np.zeros((0, 1)), np.zeros(0, dtype=bool))


def test_log_without_joints_is_refused() -> None:
    with pytest.raises(InputError, match='"run": has no joints'):
        MotionLog("run", (), (), np.zeros((4, 0)), np.ones(4, dtype=bool))


def test_repeated_joint_name_is_refused() -> None:
    with pytest.raises(InputError, match="joint names must differ"):
        replace(LOG, joint_names=("J1", "J1", "J3"))


@pytest.mark.parametrize("units", [("rad", "rad"), ("rad", "rad", "deg"), ("rad", "rad", "mm")])
def test_units_that_are_not_rad_or_m_for_each_joint_are_refused(units: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="expected 3 units, each rad or m, for joints J1, J2, J3"):
        replace(LOG, joint_units=units)


def test_recordings_begin_where_the_clock_goes_back() -> None:
    assert replace(LOG, time=np.array([0.0, 1.0, 1.0, 0.5, 0.6, 0.0])).starts == (0, 3, 5)


def test_log_without_time_is_one_recording() -> None:
    assert replace(LOG, time=None).starts == (0,)


def test_measurements_are_kept_as_given() -> None:
    assert_array_equal(LOG.q_nominal, recording(np.random.default_rng(0), rows=6).q_nominal)
