import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.serving.parked_arm import ParkedArm
from catenary.errors import InputError, UnsupportedCommandError
from catenary.plant import OperatingState

ARM = ParkedArm(("a", "b"), ("rad", "m"), [0.5, 0.1])


def test_it_stays_disabled_where_it_was_put():
    ARM.wait()
    assert ARM.operating_state() == OperatingState("DISABLED", False, False)
    assert_array_equal(ARM.measured_js().q, [0.5, 0.1])
    assert_array_equal(ARM.setpoint_js().q, [0.5, 0.1])


def test_joint_states_are_the_receivers_own():
    ARM.measured_js().q[:] = 9.0
    assert_array_equal(ARM.measured_js().q, [0.5, 0.1])


@pytest.mark.parametrize("verb", ["servo_jp", "servo_jr", "servo_jf"])
def test_it_obeys_nothing(verb):
    with pytest.raises(UnsupportedCommandError, match="parked"):
        getattr(ARM, verb)(np.zeros(2))
    with pytest.raises(UnsupportedCommandError, match="parked"):
        ARM.state_command("enable")


def test_a_number_a_joint_is_needed():
    with pytest.raises(InputError):
        ParkedArm(("a", "b"), ("rad", "m"), [0.5])
