"""What a control may be given."""

import numpy as np
import pytest

from catenary.view.page_content import Control, accepted

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
