import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.transmission.coupling import joint_forces, joints_of, tensions_for, winding_of

share = st.floats(-2.0, 2.0)
triple = st.tuples(share, share, share)


@given(triple, triple)
def test_joints_of_undoes_winding_of(coupling, q):
    assert_allclose(
        joints_of(coupling, winding_of(coupling, q)), q, atol=1e-13
    )  # a few roundings of numbers < 20


@given(triple, triple)
def test_tensions_for_undoes_joint_forces(coupling, force):
    assert_allclose(joint_forces(coupling, tensions_for(coupling, force)), force, atol=1e-13)


@given(triple, triple, triple)
def test_coupling_keeps_power(coupling, qd, tension):
    at_cables = np.dot(tension, winding_of(coupling, qd))
    at_joints = np.dot(joint_forces(coupling, tension), qd)
    assert_allclose(at_joints, at_cables, atol=1e-13)


def test_elbow_and_insertion_cables_wind_with_the_joints_before_them():
    # raven2 source: m1 = TR1 q1, m2 = TR2 (q2 + c01 q1), m3 = TR3 (q3 + c02 q1 + c12 q2)
    assert_allclose(winding_of((0.1, 0.02, 0.03), (1.0, 0.0, 0.0)), (1.0, 0.1, 0.02))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 1.0, 0.0)), (0.0, 1.0, 0.03))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 0.0, 1.0)), (0.0, 0.0, 1.0))


def test_nominal_motor_angles_at_home_are_those_of_the_robot():
    from catenary.simulation.cable_parameters import load_cable_arm

    firmware = load_cable_arm().firmware
    motor = firmware.ratio[:3] * winding_of(
        firmware.coupling, np.array([np.deg2rad(30), np.deg2rad(90), 0.40])
    )
    assert_allclose(motor, [71.312, 200.141, 899.637], atol=5e-4)  # raven2 description, printed to 1e-3 rad


def test_nominal_motor_angles_at_the_stops_are_those_of_the_robot():
    from catenary.simulation.cable_parameters import load_cable_arm

    firmware = load_cable_arm().firmware
    motor = firmware.ratio[:3] * winding_of(firmware.coupling, firmware.stop_value[:3])
    assert_allclose(motor, [0.0, 291.632, 1254.971], atol=5e-4)
