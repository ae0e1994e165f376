import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.robots.catalog import load_robot
from catenary.sensing.gravity_vector import Kind
from catenary.sensing.mounting import Mounting, TumbleSection, load_mounting, save_mounting

TURNED = Mounting(
    rotation=Rotation.from_euler("xyz", [0.3, -1.0, 2.0]).as_matrix(),
    position=np.array([0.1, -0.2, 0.3]),
    bias=np.array([0.1, 0.2, -0.3]),
    scale=np.array([1.01, 0.98, 1.0]),
    rate_bias=np.array([0.01, 0.0, -0.02]),
    acceleration_range=19.6,
    sensor='a "board" \\ 2',
)


def test_a_sensor_with_its_x_axis_up_reads_gravity_there():
    # its x along the base's z, its y along the base's y
    R_base_imu = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    gravity = Mounting(rotation=R_base_imu).gravity(np.array([9.81, 0.0, 0.0]), Kind.SPECIFIC_FORCE)
    assert_allclose(gravity, [0.0, 0.0, -9.81])


def test_a_mounting_that_leads_to_another_frame_of_the_base_is_seen_from_the_base():
    arm, at_base = load_robot("ur10e"), Mounting(position=np.array([0.1, 0.2, 0.3]), base="base")
    seen = at_base.in_base_of(arm)  # its controller's base is turned by half a turn from base_link
    assert_allclose(seen.position, [-0.1, -0.2, 0.3], atol=1e-12)
    assert_allclose(seen.rotation, np.diag([-1.0, -1.0, 1.0]), atol=1e-12)
    assert seen.base == arm.base == "base_link"
    assert seen.in_base_of(arm) is seen
    for stranger in ("cart", "wrist_1_link"):  # believed, its axes would be taken for the base's
        with pytest.raises(InputError, match=f'of "{stranger}".*expected one of base, '):
            Mounting(base=stranger).in_base_of(arm)


def test_what_a_sensor_distorts_the_mounting_puts_right(rng):
    gravity, rate = rng.normal(size=(2, 5, 3))
    reading = (-gravity @ TURNED.rotation) * TURNED.scale + TURNED.bias
    assert_allclose(TURNED.gravity(reading, Kind.SPECIFIC_FORCE), gravity, atol=1e-12)
    assert_allclose(TURNED.rate(rate @ TURNED.rotation + TURNED.rate_bias), rate, atol=1e-12)


def test_a_mounting_file_gives_back_what_was_written(tmp_path):
    path = tmp_path / "mounting.toml"
    save_mounting(path, TURNED, TumbleSection(readings=12, residual_m_s2=0.01))
    read = load_mounting(path)
    for name, value in vars(TURNED).items():
        assert_array_equal(getattr(read, name), value, err_msg=name)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "mounting: this key is missing"),
        ("[mounting]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "expected a rotation matrix"),
        ("[mounting]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nposition = [0, 0, 0]", "position_m"),
        (
            "[accelerometer]\nscale = [1, 1, 0]\n[mounting]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
            "scale: expected factors of 0.001 or more",
        ),
    ],
)
def test_wrong_mounting_files_are_refused_by_name(tmp_path, text, said):
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_mounting(path)
    assert str(path) in str(caught.value)


def test_a_mounting_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be written"):
        save_mounting(tmp_path / "none" / "m.toml", TURNED)


def test_ranges_must_be_positive():
    with pytest.raises(InputError, match="acceleration_range"):
        Mounting(acceleration_range=0.0)
