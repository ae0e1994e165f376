from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from catenary.dynamics.actuation import known_loads
from catenary.robots.actuation import Actuation, Friction, MotorInertia, Spring, actuation_terms
from catenary.robots.catalog import load_robot
from catenary.robots.joint_drives import joint_drives

C = np.array([0.0, 2.0])


def test_nothing_is_known_of_an_actuation_without_numbers():
    assert joint_drives(Actuation(friction=(Friction("a", C),)), 2) is None


def test_friction_and_rotors_of_a_joint_are_those_of_the_actuation_in_steady_sliding():
    friction = Friction("a", C, offset=False, presliding=0.01)
    actuation = Actuation(friction=(friction,), motor_inertia=(MotorInertia("m", C),))
    assert len(actuation_terms(actuation)) == 4
    known = replace(actuation, values=np.array([0.5, 0.1, 0.25, 0.02]))
    drives = joint_drives(known, 2)
    assert drives is not None
    assert drives.left_out == ()
    loads = known_loads(replace(load_robot("two_link"), actuation=known))
    assert loads is not None
    qd, qdd = np.array([[0.0, 0.7]]), np.array([[0.0, 3.0]])
    expected = drives.friction * np.sign(qd) + drives.damping * qd + drives.armature * qdd
    assert_allclose(loads.torque(0 * qd, qd, qdd), expected)


def test_what_is_no_joints_own_is_named():
    actuation = Actuation(
        friction=(Friction("both", np.ones(2), offset=False), Friction("one", C, stribeck=0.1)),
        springs=(Spring("s", C),),
    )
    drives = joint_drives(replace(actuation, values=np.ones(7)), 2)
    assert drives is not None
    assert drives.left_out == ("coulomb both", "viscous both", "offset one", "stribeck one", "spring s")
