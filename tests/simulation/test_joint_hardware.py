import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, joint_numbers, joints_of, pack_joints

MODEL = load_robot("planar_3r")
PLACES = np.array([6, 7, 8]), np.array([7, 8, 9])


def test_packed_numbers_come_back_as_they_were():
    hardware = JointHardware([1, 2, 3], [4, 5, 6], [7, 8, 9], [np.inf, 10, 11], [0, 12, 13])
    numbers = joint_numbers(MODEL, hardware, *PLACES)
    for packed, given in zip(joints_of(pack_joints(numbers)), numbers, strict=True):
        assert_array_equal(packed, given)


def test_drives_act_on_the_rotors_of_elastic_joints():
    hardware = JointHardware(friction=[1, 2, 3], armature=0.5, stiffness=[np.inf, 10, np.inf])
    numbers = joint_numbers(MODEL, hardware, *PLACES)
    assert numbers.drive.tolist() == [0, 3, 2]
    assert numbers.friction.tolist() == [1, 0, 3, 2]
    assert numbers.inertia.tolist() == [0.5, 0, 0.5, 0.5]


@pytest.mark.parametrize(
    ("hardware", "complaint"),
    [
        (JointHardware(friction=-1.0), "friction"),
        (JointHardware(friction=[1.0]), "friction"),
        (JointHardware(damping=np.nan), "damping"),
        (JointHardware(armature="heavy"), "armature"),
        (JointHardware(spring_damping=np.inf), "spring_damping"),
        (JointHardware(stiffness=100.0), 'link1": stiffness 100 and armature 0.*above zero'),
        (JointHardware(stiffness=0.0, armature=1.0), "above zero"),
        (JointHardware(stiffness=np.nan), "stiffness"),
    ],
)
def test_numbers_that_no_joint_has_are_refused(hardware, complaint):
    with pytest.raises(InputError, match=complaint):
        joint_numbers(MODEL, hardware, *PLACES)
