"""What a control may be given."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.plant import JointRanges
from catenary.view.page_content import _SPAN_S, Control, Curves, accepted, finite_ranges
from view.arms import RAVEN, Q, state

SLIDER = Control("slider", "s", "s", 0.0, (-2.0, 3.0, 0.1))
CHOICE, BUTTONS = Control("choice", "c", "c", "a", ("a", "b")), Control("buttons", "b", "b", None, ("a", "b"))
SWITCH = Control("switch", "t", "t", False)


@pytest.mark.parametrize(("value", "expected"), [(1, 1.0), (-2.0, -2.0), (1e9, 3.0), (-1e300, -2.0)])
def test_number_is_kept_within_a_sliders_ends(value: float, expected: float) -> None:
    taken = accepted(SLIDER, value)
    assert isinstance(taken, float)
    assert taken == expected


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, "1", "", None, [1.0], {}, b"1", 1j])
@pytest.mark.parametrize("control", [SLIDER, CHOICE, BUTTONS, SWITCH])
def test_what_no_control_has_is_refused(control: Control, value: object) -> None:
    assert accepted(control, value) is None


@pytest.mark.parametrize("control", [CHOICE, BUTTONS])
def test_one_of_its_options_is_taken_and_nothing_else(control: Control) -> None:
    assert [accepted(control, option) for option in ("a", "b")] == ["a", "b"]
    assert [accepted(control, option) for option in ("c", "A", "a ", 0, True)] == [None] * 5


def test_switch_is_on_or_off() -> None:
    assert [accepted(SWITCH, value) for value in (True, False)] == [True, False]
    assert [accepted(SWITCH, value) for value in (1, 0.0, "on")] == [None] * 3


def test_ranges_are_finite_and_hold_the_limits_that_there_are() -> None:
    lower, upper = np.array([-np.inf, 5.0, -np.inf, -1.0]), np.array([-4.0, np.inf, np.inf, 2.0])
    ranges = finite_ranges(JointRanges(tuple("abcd"), ("rad", "rad", "m", "m"), lower, upper))
    assert np.isfinite([ranges.lower, ranges.upper]).all()
    assert (ranges.lower < ranges.upper).all()
    assert (ranges.lower[[1, 3]], ranges.upper[[0, 3]]) == (pytest.approx(lower[[1, 3]]), pytest.approx(upper[[0, 3]]))


def curve(curves: Curves, joint: int, plot: int, label: str) -> np.ndarray:
    (found,) = [one for one in curves.plots(joint)[plot].curves if one.label == label]
    return found.values


def filled() -> Curves:
    curves = Curves(RAVEN)
    for k in range(50):
        curves.add(
            state(0.1 * k, encoder=Q - np.array([0.0, np.deg2rad(2.0), 0.003]), calibrated=Q, interval=np.full(3, 0.001),
                  tau=np.array([3.0, 2.0, 1.0]), gravity_tau=np.array([2.5, 2.0, 1.5]), feedback=np.zeros(3))
        )  # fmt: skip
    return curves


def test_errors_are_in_degrees_and_millimetres_reported_less_true() -> None:
    assert_allclose(curve(filled(), 1, 0, "reported"), 2.0)
    assert_allclose(curve(filled(), 2, 0, "reported"), 3.0)
    assert_allclose(curve(filled(), 2, 0, "interval \u00b1"), 1.0)
    assert filled().plots(1)[0].title == "elbow: error [deg]"
    assert filled().plots(2)[1].title == "insertion: torque [N]"


def test_parts_of_the_torque_sum_to_it() -> None:
    curves = filled()
    total, gravity, rest = (curve(curves, 0, 1, label) for label in ("total", "gravity", "friction, inertia"))
    assert_allclose(gravity + rest, total)


def test_curves_of_which_nothing_is_known_are_left_out_and_gaps_are_level() -> None:
    curves = Curves(RAVEN)
    for k, known in enumerate([False, True, False, True]):
        curves.add(state(float(k), **({"setpoint": Q - k} if known else {})))
    (tracking,) = curves.plots(2)[0].known()
    assert tracking.label == "tracking"
    assert_allclose(tracking.values, [1000.0, 1000.0, 1000.0, 3000.0])


def test_curves_span_half_a_minute_and_begin_anew_when_time_goes_back() -> None:
    curves = Curves(RAVEN)
    for k in range(3000):
        curves.add(state(0.04 * k))
    time = curves.plots(0)[0].time
    assert _SPAN_S - 1.0 < time[-1] - time[0] < 1.3 * _SPAN_S
    assert time[-1] == 0.0  # seconds from now
    curves.add(state(0.0))
    assert len(curves.plots(0)[0].time) == 1


def test_recording_is_drawn_about_the_present() -> None:
    time = np.arange(0.0, 100.0, 0.1)
    rows = np.tile(time[:, None], (1, 3))
    curves = Curves(RAVEN, {"time": time, "tau": rows})
    curves.add(state(40.0))
    torque = curves.plots(0)[1]
    assert_allclose(torque.time[[0, -1]], [-15.0, 15.0], atol=0.11)
    total = torque.known()[0]
    assert_allclose(total.values - 40.0, torque.time)  # each value where it belongs
