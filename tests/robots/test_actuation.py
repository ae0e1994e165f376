import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import ConfigError, InputError
from catenary.robots.table import load_table

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
        "[actuation.filter]\norder = 6\ncutoff_hz = 5\ncut_samples = 20\nperiod_samples = 100\n"
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
    assert (actuation.filter.order, actuation.filter.period_samples) == (6, 100)
    assert actuation.weighting == "residual"
    assert_array_equal(actuation.effort_scale, [1, -2])
    with pytest.raises(ValueError, match="read-only"):
        actuation.friction[0].combination[0] = 1.0


def test_a_coordinate_that_moves_no_joint_needs_an_effect_of_its_own(load):
    assert load(FRICTION) is not None
    with pytest.raises(InputError, match="coordinates motor move no joint"):
        load('[[actuation.friction]]\nname = "f"\non = { a = 1 }\n')


LEVER = "lever = { arm_m = 0.2, anchor_m = 0.1, rest_length_m = 0.05, angle_deg = 0 }\n"


@pytest.mark.parametrize(("text", "error", "said"), [
    ("[actuation]\nfrictions = 1\n", ConfigError, "actuation: frictions: unknown key"),
    ('[actuation]\nweighting = "best"\n', ConfigError, "actuation: weighting"),
    ("[actuation.filter]\norder = 4\n", ConfigError, "cutoff_hz: this key is missing"),
    ("[actuation.filter]\norder = 0\ncutoff_hz = 1\ncut_samples = 0\n", ConfigError, "order"),
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
