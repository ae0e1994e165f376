from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.control.limits import TorqueLimits
from catenary.errors import InputError
from compilations import compilations

DT = 0.001
ANY = st.floats(allow_nan=True, allow_infinity=True)


def once(limits: TorqueLimits, tau: list[float], q: list[float] | None = None) -> list[float]:
    return limits.apply(np.array(tau), np.array(q if q is not None else [0.0] * len(tau)), DT).tolist()


def test_small_torques_pass_unchanged_and_large_ones_are_cut() -> None:
    limits = TorqueLimits([2.0, 3.0], slew=[1e6, 1e6], lower=[-1.0, -1.0], upper=[1.0, 1.0], taper=[0.1, 0.0])
    assert once(limits, [1.9, -2.9], [0.5, 0.99]) == [1.9, -2.9]
    assert limits.limited == 0
    assert once(limits, [5.0, -5.0]) == [2.0, -3.0]
    assert limits.limited == 1


@pytest.mark.parametrize(
    ("applied", "demanded", "sent"),
    [(0.0, [5.0, 5.0, 1.5, -9.0], [1.0, 2.0, 1.5, 0.5]), (7.0, [0.0], [6.0]), (5.0, [np.nan, 5.0], [4.0, 5.0])],
    ids=["from zero", "from the torque being applied", "at a single NaN"],
)
def test_torque_changes_no_faster_than_the_slew_rate(applied, demanded, sent) -> None:
    limits = TorqueLimits([10.0], slew=[1000.0])
    limits.reset(np.array([applied]))
    assert [once(limits, [tau])[0] for tau in demanded] == sent


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_torque_towards_a_joint_limit_fades_and_away_from_it_stays(side: float) -> None:
    q, four = side * np.array([0.8, 0.9, 0.95, 1.0, 1.1]), np.full(5, side * 4.0)
    one = np.ones(5)
    limits = TorqueLimits(9.0 * one, lower=-one, upper=one, taper=0.2 * one)
    assert_allclose(limits.apply(four, q, DT), side * np.array([4.0, 2.0, 1.0, 0.0, 0.0]), atol=1e-12)
    assert_array_equal(limits.apply(-four, q, DT), -four)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_becomes_zero_torque_of_that_joint(bad: float) -> None:
    limits = TorqueLimits([2.0, 2.0])
    assert once(limits, [bad, 1.0]) == [0.0, 1.0]
    assert once(limits, [1.0, 1.0], [0.0, bad]) == [1.0, 0.0]
    assert limits.not_finite == 2


ODD = {
    "(2, 1)": np.ones((2, 1)),
    "(1, 2)": np.ones((1, 2)),
    "too few": np.ones(1),
    "too many": np.ones(3),
    "scalar": 1.0,
    "None": None,
    "complex": np.ones(2, dtype=complex),
    "text": ["1", "2"],
    "objects": [1.0, object()],
}


@pytest.mark.parametrize("tau", ODD.values(), ids=ODD)
def test_a_torque_that_is_no_array_of_numbers_of_the_joints_is_refused(tau: Any) -> None:
    limits, q = TorqueLimits([2.0, 2.0]), np.zeros(2)
    for arguments in ((tau, q), (q, tau)):
        with pytest.raises(InputError, match=r"^(torque|q): expected [a-z ]*shape \(2,\), got|numbers of shape"):
            limits.apply(*arguments, DT)


@pytest.mark.parametrize(
    "tau", [[3, -1], (3.0, -1.0), np.array([3, -1]), np.array([3.0, -1.0], dtype=np.float32)], ids=repr
)
def test_torques_of_any_type_of_number_are_taken_without_compiling_anew(tau: Any) -> None:
    limits = TorqueLimits([2.0, 2.0])
    limits.reset(np.zeros(2))
    with compilations() as found:
        assert limits.apply(tau, np.zeros(2, dtype=np.float32), 1).tolist() == [2.0, -1.0]  # type: ignore[arg-type]
    assert found == []


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(ANY, ANY), min_size=1, max_size=8))
def test_whatever_is_demanded_what_is_sent_is_a_number_within_the_limits(demands) -> None:
    limits = TorqueLimits([2.0], slew=[500.0], lower=[-1.0], upper=[1.0], taper=[0.1])
    last = 0.0
    for tau, q in demands:
        (sent,) = once(limits, [tau], [q])
        assert abs(sent) <= 2.0
        assert abs(sent - last) <= 0.5 + 1e-12
        last = sent


def test_reset_forgets_and_takes_nan_as_no_torque() -> None:
    limits = TorqueLimits([2.0], slew=[1000.0])
    once(limits, [np.nan])
    limits.reset(np.array([np.nan]))
    assert (limits.limited, limits.not_finite) == (0, 0)
    assert once(limits, [0.5]) == [0.5]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"torque": [-1.0]}, "torque: expected zero or more"),
        ({"torque": [np.nan]}, "torque: expected zero or more"),
        ({"torque": [1.0], "slew": [1.0, 2.0]}, "slew: expected shape"),
        ({"torque": [1.0], "taper": [0.1]}, "taper: expected the joint limits"),
        ({"torque": [1.0], "lower": [1.0], "upper": [0.0]}, "lower"),
    ],
)
def test_impossible_limits_are_refused(arguments: dict[str, list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message):
        TorqueLimits(**arguments)
