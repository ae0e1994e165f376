import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.simulation.joint_hardware import JointHardware, drive_parameters
from catenary.simulation.mujoco_plant import MujocoPlant

MODEL = load_robot("planar_3r")
PLACES = np.array([6, 7, 8]), np.array([7, 8, 9])


def test_drives_act_on_the_rotors_of_elastic_joints():
    hardware = JointHardware(friction=[1, 2, 3], armature=0.5, stiffness=[np.inf, 10, np.inf])
    numbers = drive_parameters(MODEL, hardware, *PLACES)
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
        drive_parameters(MODEL, hardware, *PLACES)


@pytest.mark.parametrize(
    "hardware",
    [
        JointHardware(damping=1e5),
        JointHardware(stiffness=1e7, armature=0.1),
        JointHardware(stiffness=1e3, armature=0.1, spring_damping=1e4),
    ],
)
def test_springs_and_dampers_too_stiff_for_the_step_are_refused(hardware):
    with pytest.raises(InputError, match="as many substeps"):
        MujocoPlant(load_robot("two_link"), hardware=hardware)


def test_as_many_substeps_as_the_complaint_says_are_enough():
    model, stiff = load_robot("two_link"), JointHardware(stiffness=1e6, armature=0.1)
    with pytest.raises(InputError) as complaint:
        MujocoPlant(model, hardware=stiff)
    times = int(str(complaint.value).split("at least ")[1].split()[0])
    q = np.array([0.5, 0.3])
    plant = MujocoPlant(model, start=q, hardware=stiff, substeps=times)
    plant.home()
    for _ in range(500):
        plant.servo_jf(gravity_torque(model, q, [0.0, 0.0, -9.81]))
        plant.wait()
    # springs wind up by tau / K, and what swings stays that small
    assert_allclose(plant.telemetry()["q_true"], q, atol=1e-4)


def test_joints_that_move_no_mass_are_refused_by_name_until_they_have_a_rotor():
    with pytest.raises(InputError, match="roll, wrist, tool"):
        MujocoPlant(load_robot("raven2_full"))
    MujocoPlant(load_robot("raven2_full"), hardware=JointHardware(armature=1e-4))
