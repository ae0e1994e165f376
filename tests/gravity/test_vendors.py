import numpy as np
import pytest

from catenary.errors import InputError
from catenary.gravity.vendors import VENDORS, in_controller_base, vendor_command, vendor_of
from catenary.robots.catalog import load_robot
from catenary.sensing.gravity_vector import tilted_gravity

S, C = 9.81 * np.sin(0.3), 9.81 * np.cos(0.3)


@pytest.mark.parametrize(
    ("name", "gravity", "said"),
    [
        # Universal Robots, "7th axis gravity settings": at rest, and accelerated along x by half a g
        ("ur", (0.0, 0.0, -9.82), "set_gravity([0.0000, 0.0000, 9.8200])"),
        ("ur", (-4.91, 0.0, -9.82), "set_gravity([4.9100, 0.0000, 9.8200])"),
        # its script manual, turned about x: set_gravity([0, 9.82 sin(theta), 9.82 cos(theta)])
        ("ur", tilted_gravity(0.3, 0.0), f"set_gravity([0.0000, {S:.4f}, {C:.4f}])"),
        ("kortex", (0.0, 0.0, -9.81), "gravity_x=0.0000, gravity_y=0.0000, gravity_z=-9.8100"),
    ],
)
def test_a_vendors_controller_is_told_as_its_manual_says(name, gravity, said):
    assert said in vendor_command(name, gravity)


def test_a_franka_cannot_be_told_and_says_what_to_add():
    assert vendor_command("franka", (0.0, 0.0, -9.81)) == ""
    assert "add gravity_delta" in vendor_of("franka").limits


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (0.0, 0.0, -981.0), (np.nan, 0.0, -9.8)])
@pytest.mark.parametrize("name", [name for name, vendor in VENDORS.items() if vendor.sign])
def test_what_no_base_feels_is_told_to_nobody(name, gravity):
    with pytest.raises(InputError):
        vendor_command(name, gravity)


def test_a_vendor_that_there_is_not_is_refused():
    with pytest.raises(InputError, match="expected one of ur, kortex, franka"):
        vendor_command("acme", (0.0, 0.0, -9.81))


def test_a_universal_robots_controller_has_a_base_of_its_own():
    ur10e, gravity = load_robot("ur10e"), tilted_gravity(0.2, 0.3)
    np.testing.assert_allclose(in_controller_base("ur", ur10e, gravity), gravity * [-1.0, -1.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(in_controller_base("kortex", ur10e, gravity), gravity)
    for base, signs in (("base", 1.0), ("left_base_link", [-1.0, -1.0, 1.0])):
        np.testing.assert_allclose(in_controller_base("ur", base, gravity), gravity * signs)
    with pytest.raises(InputError, match=r'axes of "world", expected base or base_link'):
        in_controller_base("ur", "world", gravity)
