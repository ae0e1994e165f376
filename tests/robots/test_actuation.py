from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.config import parse_settings, plain_data
from catenary.dynamics.actuation_loads import known_loads
from catenary.errors import ConfigError, InputError
from catenary.robots.actuation import Actuation, Friction, MotorInertia, Spring, actuation_terms, joint_drives
from catenary.robots.catalog import load_robot
from catenary.robots.dh_table import load_table

ARM = """
name = "r"
convention = "modified"
sources = ["assumed"]
[[coordinate]]
name = "a"
unit = "rad"
[[coordinate]]
name = "motor"
unit = "rad"
[[link]]
name = "upper"
joint = "revolute"
alpha_deg = 0
a_m = 0
d_m = 0
theta_deg = 0
variable = { a = 1 }
"""
FRICTION = '[[actuation.friction]]\nname = "f"\non = { a = 2, motor = -1.5 }\noffset = false\n'


@pytest.fixture
def load(tmp_path):
    def load_text(text):
        path = tmp_path / "robot.toml"
        path.write_text(ARM + text)
        return load_table(path).actuation

    return load_text


def test_a_table_says_what_loads_the_joints(load):
    actuation = load(
        '[actuation]\nweighting = "residual"\ncoulomb_velocity = 0.02\neffort_scale = [1, -2]\n'
        "[actuation.filter]\norder = 6\ncutoff_hz = 5\ncut_time_constants = 2.0\n"
        + FRICTION
        + '[[actuation.motor_inertia]]\nname = "m"\non = { motor = 1 }\n'
        '[[actuation.spring]]\nname = "s"\non = { a = -1 }\n'
        "lever = { arm_m = 0.01, anchor_m = 0.1, rest_length_m = 0.05, angle_deg = 180 }\n"
        '[[actuation.known_torque]]\nname = "k"\nof = { a = 1 }\non = { motor = 3 }\npolynomial = [1, 2]\n'
    )
    assert actuation is not None
    assert_array_equal(actuation.friction[0].combination, [2, -1.5])
    assert (actuation.friction[0].coulomb, actuation.friction[0].offset) == (True, False)
    assert_array_equal(actuation.motor_inertia[0].combination, [0, 1])
    assert actuation.springs[0].lever is not None
    assert_allclose(actuation.springs[0].lever.angle, np.pi)
    assert_array_equal(actuation.known_torques[0].along, [0, 3])
    assert (actuation.filter.order, actuation.filter.cut_time_constants) == (6, 2.0)
    assert actuation.weighting == "residual"
    assert_array_equal(actuation.effort_scale, [1, -2])
    with pytest.raises(ValueError, match="read-only"):
        actuation.friction[0].combination[0] = 1.0
    record = plain_data(actuation)
    assert record["friction"][0]["on"] == [2.0, -1.5]
    assert plain_data(parse_settings(record, Actuation, "actuation")) == record
    record["spring"][0]["lever"]["arm"] = 1.0
    with pytest.raises(ConfigError, match=r"lever: arm: unknown key.*ends in its unit: arm_m"):
        parse_settings(record, Actuation, "actuation")


def test_a_coordinate_that_moves_no_joint_needs_an_effect_of_its_own(load):
    assert load(FRICTION) is not None
    with pytest.raises(InputError, match="coordinates motor move no joint"):
        load('[[actuation.friction]]\nname = "f"\non = { a = 1 }\n')


LEVER = "lever = { arm_m = 0.2, anchor_m = 0.1, rest_length_m = 0.05, angle_deg = 0 }\n"


@pytest.mark.parametrize(("text", "error", "said"), [
    ("[actuation]\nfrictions = 1\n", ConfigError, "actuation: frictions: unknown key"),
    ('[actuation]\nweighting = "best"\n', ConfigError, "actuation: weighting"),
    ("[actuation.filter]\norder = 4\n", ConfigError, "cutoff_hz: this key is missing"),
    ("[actuation.filter]\norder = 0\ncutoff_hz = 1\ncut_time_constants = 0\n", ConfigError, "order"),
    (FRICTION.replace("motor", "b"), ConfigError, 'unknown coordinate "b"; coordinates: a, motor'),
    ('[[actuation.friction]]\nname = "f"\non = {}\n', ConfigError, 'friction[0] "f": on'),
    (FRICTION + FRICTION, InputError, 'friction "f": is there twice'),
    (FRICTION.replace("2, motor = -1.5", "0"), InputError, "acts on no coordinate"),
    (
        '[[actuation.spring]]\nname = "s"\non = { motor = 1 }\n' + LEVER,
        InputError,
        "expected an arm above 0",
    ),
    ("[actuation]\neffort_scale = [1]\n" + FRICTION, InputError, "effort scale: expected 2 factors, got 1"),
])  # fmt: skip
def test_effects_that_cannot_be_meant_are_refused(load, text, error, said):
    with pytest.raises(error) as caught:
        load(text)
    assert said in str(caught.value)


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
