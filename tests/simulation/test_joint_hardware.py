import numpy as np
import pytest

from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, drive_parameters

MODEL = load_robot("planar_3r")
PLACES = np.array([6, 7, 8]), np.array([7, 8, 9])


def test_drives_act_on_the_rotors_of_elastic_joints():
    hardware = JointHardware(friction=[1, 2, 3], armature=0.5, stiffness=[np.inf, 10, np.inf])
    numbers = drive_parameters(MODEL, hardware, *PLACES)
    assert numbers.joints.drive.tolist() == [0, 3, 2]
    assert numbers.parts.friction.tolist() == [1, 0, 3, 2]
    assert numbers.parts.inertia.tolist() == [0.5, 0, 0.5, 0.5]


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
        drive_parameters(MODEL, hardware, *PLACES)
