import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import ConfigError
from catenary.simulation.cable_parameters import RAVEN2, RAVEN2_STIFF, load_cable_arm, right_arm, varied_arm
from oracles.cable_arms import ROBOTS


def test_numbers_at_the_joints_are_those_of_the_mechanism():
    _, cable, f, _, _ = load_cable_arm()
    assert_allclose(cable.rotor_inertia * cable.ratio**2, [0.26, 0.207, 65.0], rtol=0.01)  # kg m2, kg m2, kg
    stiffness = f.kp[:3] * f.ratio[:3] ** 2 / f.gearbox[:3]
    assert_allclose(stiffness, [454.3, 361.7, 57_055.0], rtol=1e-3)  # Nm/rad, Nm/rad, N/m
    threshold = f.home_threshold / f.dac_per_ampere * f.torque_constant * f.ratio
    # Nm, N for the third
    assert_allclose(threshold, [6.317, 5.637, 76.29, 0.1010, 0.1860, 0.1993, 0.1993], rtol=1e-3)


def test_right_arm_has_other_signs_and_a_less_damped_insertion():
    left, right = load_cable_arm(), right_arm(load_cable_arm())
    assert_array_equal(right.firmware.dac_sign, [1, 1, 1, -1, -1, 1, -1])
    assert_array_equal(right.firmware.tool_sign, -left.firmware.tool_sign)
    assert_array_equal(right.firmware.kd[:3], [0.008, 0.008, 0.010])
    assert_array_equal(right.cable.stiffness, left.cable.stiffness)


@pytest.mark.parametrize(("robot", "within"), [(RAVEN2_STIFF, 1e-9), (RAVEN2, 0.05)])
def test_firmware_and_mechanism_agree_on_how_the_tool_follows_the_insertion(robot, within):
    arm = load_cable_arm(robot)
    follow = arm.firmware.tool_sign / arm.firmware.insertion_ratio * np.array([1.0, 1.0, -1.0, 1.0])
    assert_allclose(arm.cable.tool_carried, follow, rtol=within)
    assert_allclose(arm.cable.tool_ratio, arm.firmware.ratio[3:])


def test_drawn_arms_spread_as_declared():
    nominal, rng = load_cable_arm(), np.random.default_rng(0)
    arms = [varied_arm(nominal, rng).cable for _ in range(400)]
    stiffness = np.std([np.log(c.stiffness / nominal.cable.stiffness) for c in arms], axis=0)
    ratio = np.std([c.ratio_error - nominal.cable.ratio_error for c in arms], axis=0)
    assert_allclose(stiffness, 0.15, rtol=0.15)  # of 400 draws
    assert_allclose(ratio, 0.01, rtol=0.15)


def test_a_robot_laid_over_another_has_its_own_numbers_and_the_others():
    plain, laid = (load_cable_arm(robot) for robot in ROBOTS)
    assert (laid.cable.node_friction > 0.0).all()
    assert not plain.cable.node_friction.any()
    assert_array_equal(laid.cable.tool_ratio, plain.cable.tool_ratio)
    assert laid.firmware == plain.firmware


def test_fitted_numbers_with_friction_are_plausible_and_say_why():
    file = load_cable_arm(RAVEN2).file
    assert all(entry.unit for table in (file.cable, file.firmware, file.rig) for entry in table.values())
    own = [entry for table in (file.cable, file.rig) for entry in table.values() if entry.least is not None]
    assert len(own) > 10
    for entry in own:
        assert entry.note


@pytest.mark.parametrize("robot", ROBOTS)
def test_one_robot_drawn_twice_differs_in_phases_and_friction(robot):
    arm = load_cable_arm(robot)
    one, two = (varied_arm(arm, np.random.default_rng(seed)).cable for seed in (1, 2))
    for name in ("capstan_phase", "idler_phase", "rotor_friction", "tool_friction"):
        assert (one[name] != two[name]).all()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[cable.damping]", "[cable.dampnig]", "missing damping; unknown dampnig"),
        ("value = [1.5, 0.6, 60.0]", "value = [1.5, 0.6]", "damping: expected 3 numbers, got 2"),
        ('origin = "datasheet-memory"', 'origin = "hearsay"', "origin"),
        ("value = [1.5, 0.6, 60.0]", "value = [1.5, 0.6, 60.0]\nmost = [1.4, 1.0, 90.0]", "damping: .* plausible are"),
        ("value = [1.5, 0.6, 60.0]", "value = [1.5, 0.6, 60.0]\nleast = [1.4]", "damping: expected 3 numbers, got 1"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, old, new, message):
    from importlib.resources import files

    text = (files("catenary.simulation") / "data" / "raven2.toml").read_text()
    path = tmp_path / "arm.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError, match=message):
        load_cable_arm(path)
