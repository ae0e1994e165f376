"""The robot's own gravity compensation, as its firmware adds it."""

import copy
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque, potential_energy
from catenary.nodes.serve import Serving, make_server
from catenary.open_robot import Simulated
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.firmware import ControlState
from catenary.simulation.own_gravity import NOMINAL, grav_dir_of, gravity_of, own_gravity, weigh
from catenary.simulation.records import POSITION
from catenary.transmission.coupling import tensions_for
from oracles.cable_arms import homed_plant, smooth_motion, with_linear_cables

TILT = FixedBase(0.0, np.deg2rad(20.0))
# the robot's code: grav_dir (x, y, z) in cm/s2 to m/s2 in frame 0 of each arm
FRAME_0 = {
    "raven2": np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]) / 100.0,
    "raven2_right": np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]) / 100.0,
}


def gravity_share(plant: CablePlant) -> np.ndarray:
    return plant.control.gravity_torque.copy()


def frictionless(*args: Any, **options: Any) -> CablePlant:
    """A homed arm whose cables have become springs without friction."""
    plant = homed_plant(*args, **options)
    plant.cable = with_linear_cables(plant.cable)
    return plant


def ran(plant: CablePlant, seconds: float) -> CablePlant:
    plant.run(np.full((round(1000 * seconds), 7), np.nan))
    return plant


def settled(plant: CablePlant) -> tuple[np.ndarray, np.ndarray]:
    """What the PD and what the compensation ask of the positioning joints' motors, at rest: means of a second [Nm]."""
    ran(plant, 2.0)
    torque = plant.run(np.full((1000, 7), np.nan)).torque[:, :3].mean(axis=0)
    return torque - gravity_share(plant), gravity_share(plant)


@pytest.mark.parametrize("name", FRAME_0)
def test_its_torques_are_the_gradient_of_potential_energy_through_each_joints_own_ratio(name: str) -> None:
    arm, model, rng = load_cable_arm(), load_robot(name), np.random.default_rng(0)
    frame_0 = load_robot(name.replace("raven2", "raven2_full")).frames["frame0"].pose.rotation
    firmware, own, control = arm.firmware, own_gravity(model.tree), ControlState()
    for _ in range(20):
        q = rng.uniform([0.0, 0.8, 0.23], [1.57, 2.3, 0.56])
        grav_dir = rng.integers(-1500, 1500, 3).tolist()
        own.gravity, control.joint[:3] = gravity_of(grav_dir), q
        weigh(firmware, own, control)
        gravity = frame_0 @ FRAME_0[name] @ grav_dir
        h = 1e-5
        slope = [
            (potential_energy(model, q + h * e, gravity) - potential_energy(model, q - h * e, gravity))
            / (2 * h)
            for e in np.eye(3)
        ]
        motors = np.array(slope) * firmware.gearbox[:3] / firmware.ratio[:3]
        assert_allclose(control.gravity_torque, motors, atol=1e-9)  # central difference, h = 1e-5


def test_integers_of_gravity_come_back() -> None:
    assert_array_equal(gravity_of(NOMINAL), [0.0, 0.0, -9.8])
    assert grav_dir_of(gravity_of((31, -20, 900))) == (31, -20, 900)


def test_by_no_gravity_it_is_bit_for_bit_as_without() -> None:
    logs = []
    for plant in (homed_plant(seed=2), homed_plant(seed=2, grav_dir=(0, 0, 0))):
        logs.append(plant.run(smooth_motion(plant.setpoint_js().q, 2.0)))
    assert logs[0].tobytes() == logs[1].tobytes()


def test_it_acts_once_homed_with_the_pedal_up_or_down_and_in_no_other_state() -> None:
    plant = CablePlant(grav_dir=NOMINAL)
    assert not gravity_share(plant).any()
    plant.state_command("enable")
    plant.state_command("home")
    while plant.operating_state().is_busy:
        assert not gravity_share(plant).any()
        plant.wait()
    assert gravity_share(ran(plant, 0.01)).all()
    plant.state_command("pause")
    plant.wait()
    assert_allclose(plant.telemetry()["tau"][:3], gravity_share(plant))  # the PD is off, the brakes hold
    assert plant.telemetry()["dac_val"][:3].all()
    plant.state_command("disable")
    plant.wait()
    assert not plant.telemetry()["tau"].any()
    plant.state_command("enable")
    plant.state_command("home")  # again
    plant.wait()
    assert not gravity_share(plant).any()


def test_the_reported_torque_is_the_sum_of_both() -> None:
    plant = ran(homed_plant(grav_dir=NOMINAL), 0.5)
    log = plant.run(np.full((1, 7), np.nan))
    asked = plant.firmware.kp[:3] * (log.motor_setpoint[0] - log.motor[0])[:3]
    asked -= plant.firmware.kd[:3] * log.motor_velocity[0, :3]
    assert_allclose(log.torque[0, :3], asked + plant.control.gravity_torque, rtol=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_arm_without_friction_sags_less_and_by_the_coupling_that_is_left_out(side: str) -> None:
    model = load_robot("raven2" if side == "left" else "raven2_right")
    sag = []
    for grav_dir in (None, NOMINAL):
        plant = frictionless(side, grav_dir=grav_dir)
        feedback, share = settled(plant)
        needed = gravity_torque(model, plant.state.q, (0.0, 0.0, -9.81))
        ratio = plant.cable.ratio * (1.0 + plant.cable.ratio_error)
        motors = np.array(tensions_for(plant.cable.coupling, needed)) * plant.firmware.gearbox[:3] / ratio
        assert_allclose(feedback + share, motors, atol=2e-3)  # a step of an encoder is worth 5e-4 Nm
        sag.append(np.abs(feedback))
    assert sag[1][2] < 0.1 * sag[0][2]  # no other joint's motor pulls on the third
    assert np.linalg.norm(sag[1]) < 0.5 * np.linalg.norm(sag[0])


def test_on_a_tilted_base_it_goes_by_what_it_was_told_until_the_arm_is_disabled() -> None:
    told = frictionless(base=TILT, grav_dir=NOMINAL)
    untold = copy.deepcopy(told)
    told.grav_dir = grav_dir_of(told.measured_js().gravity)
    assert untold.grav_dir == NOMINAL
    model, reported = load_robot("raven2"), told.control.joint[:3].copy()
    errors = []
    for plant, gravity in ((untold, (0.0, 0.0, -9.8)), (told, told.measured_js().gravity)):
        feedback, share = settled(plant)
        holding = gravity_torque(model, reported, gravity)
        motors = holding * plant.firmware.gearbox[:3] / plant.firmware.ratio[:3]
        assert_allclose(share, motors, atol=1e-3)  # grav_dir is in whole cm/s2, and the arm sags a little
        errors.append(abs(feedback[0]))
    assert errors[1] < 0.5 * errors[0]
    told.state_command("disable")
    assert told.grav_dir == NOMINAL


def test_torques_that_are_commanded_get_none_of_it() -> None:
    plant, plain = (homed_plant(grav_dir=by) for by in (NOMINAL, None))
    plain.state, plain.control = copy.deepcopy(plant.state), copy.deepcopy(plant.control)
    for arm in (plant, plain):
        arm.servo_jf(np.array([0.1, -0.2, 2.0]))
        arm.wait()
    assert_array_equal(plant.telemetry()["tau"], plain.telemetry()["tau"])
    plant.servo_jp(plant.setpoint_js().q)
    assert set(plant.control.mode) == {POSITION}


@pytest.mark.parametrize("grav_dir", [(0, 0), (0.5, 0, 980), (0, 0, 40_000), (0, np.nan, 980)], ids=str)
def test_what_is_no_gravity_in_whole_numbers_is_refused(grav_dir: tuple) -> None:
    with pytest.raises(InputError, match="grav_dir"):
        CablePlant(grav_dir=grav_dir)


def test_a_robot_without_it_takes_no_gravity() -> None:
    plant = CablePlant()
    assert plant.grav_dir is None
    with pytest.raises(InputError, match="without gravity compensation"):
        plant.grav_dir = NOMINAL


def test_a_served_robot_has_it_if_asked_for_and_says_so_in_its_torques() -> None:
    for grav_dir in (None, NOMINAL):
        serving = Serving(simulated=Simulated(grav_dir=grav_dir))  # homed, and PAUSED
        network = LoopbackNetwork()
        client = Loopback("client", network)
        heard = client.subscribe("/ravenstate", "raven_2/raven_state")
        server = make_server(serving, Loopback("robot", network))
        for _ in range(3):
            server.tick()
        message = heard.take()[-1][0]
        assert message.runlevel == 2  # pedal up: only gravity's torques are asked for
        expected = gravity_share(server.arms["gold"].plant)
        assert_allclose(message.tau[:3], expected, rtol=1e-6)  # floats
        assert message.tau[:3].any() == (grav_dir is not None)
        assert not message.tau[3:].any()
