import numpy as np
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.spatial import LEVEL
from papers.gravity.raven_base import Z0, rocking_base, turned_base

NOW = np.zeros(1)


def test_turning_the_base_loads_joint_1_as_turning_joint_1_does() -> None:
    model, q = load_robot("raven2"), np.array([0.4, 1.5, 0.4])
    turned = gravity_torque(model, q, turned_base(25.0).sample(NOW).gravity[0])
    moved = gravity_torque(model, q + np.deg2rad([25.0, 0.0, 0.0]), LEVEL)
    assert_allclose(turned[0], moved[0])


def test_z0_is_the_axis_of_joint_1() -> None:
    # nothing that pulls along its axis loads a joint
    torque = gravity_torque(load_robot("raven2"), [0.4, 1.5, 0.4], Z0)
    assert_allclose(torque[0], 0.0, atol=1e-12)


def test_the_base_rocks_between_10_and_20_deg_within_a_second() -> None:
    base = rocking_base()
    gravity = base.sample(np.linspace(0.0, 1.0, 201)).gravity
    lowest, highest = turned_base(10.0).sample(NOW).gravity[0], turned_base(20.0).sample(NOW).gravity[0]
    assert_allclose(gravity[:, 0].min(), min(lowest[0], highest[0]), rtol=1e-4)
    assert_allclose(gravity[:, 0].max(), max(lowest[0], highest[0]), rtol=1e-4)
    assert_allclose(gravity[0], gravity[-1])
