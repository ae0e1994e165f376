import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import load_cable_arm
from catenary.transmission.cable_elasticity import joint_forces, joints_of, tensions_for, winding_of

FIRMWARE = load_cable_arm().firmware
share = st.floats(-2.0, 2.0)
triple = st.tuples(share, share, share)


@given(triple, triple, triple)
def test_coupling_has_an_inverse_and_keeps_power(coupling, qd, tension):
    # a few roundings of numbers < 20
    assert_allclose(joints_of(coupling, winding_of(coupling, qd)), qd, atol=1e-13)
    assert_allclose(joint_forces(coupling, tensions_for(coupling, tension)), tension, atol=1e-13)
    at_cables = np.dot(tension, winding_of(coupling, qd))
    assert_allclose(np.dot(joint_forces(coupling, tension), qd), at_cables, atol=1e-13)


def test_elbow_and_insertion_cables_wind_with_the_joints_before_them():
    # raven2 source: m1 = TR1 q1, m2 = TR2 (q2 + c01 q1), m3 = TR3 (q3 + c02 q1 + c12 q2)
    assert_allclose(winding_of((0.1, 0.02, 0.03), (1.0, 0.0, 0.0)), (1.0, 0.1, 0.02))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 1.0, 0.0)), (0.0, 1.0, 0.03))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 0.0, 1.0)), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("q", "motor"),
    [
        ([np.deg2rad(30), np.deg2rad(90), 0.40], [71.312, 200.141, 899.637]),  # home
        (FIRMWARE.stop_value[:3], [0.0, 291.632, 1254.971]),
    ],
)
def test_nominal_motor_angles_are_those_of_the_robot(q, motor):
    # raven2 description, printed to 1e-3 rad
    assert_allclose(FIRMWARE.ratio[:3] * winding_of(FIRMWARE.coupling, q), motor, atol=5e-4)
