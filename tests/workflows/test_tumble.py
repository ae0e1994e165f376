import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.sensing.mounting import Mounting, load_mounting, save_mounting
from catenary.simulation.sensors import SensorModel
from catenary.workflows.sense import StillReading
from catenary.workflows.tumble import ATTITUDES, run_tumble, simulated_reader

TRUE = Mounting(
    rotation=Rotation.from_euler("xyz", [0.4, -0.8, 2.0]).as_matrix(),
    bias=np.array([0.3, -0.2, 0.4]),
    scale=np.array([1.02, 0.98, 1.01]),
    rate_bias=np.array([0.02, -0.01, 0.03]),
)
READER = simulated_reader(SensorModel(mounting=TRUE), seed=1)
READINGS = {attitude.name: READER(attitude) for attitude in ATTITUDES}


def test_a_tumble_finds_bias_scale_and_rotation_of_a_sensor():
    start = Mounting(position=np.array([0.1, 0.2, 0.3]))
    outcome = run_tumble(lambda attitude: READINGS[attitude.name], start=start)
    assert outcome.faults == ()
    # noise of 0.04 m/s2 over 200 samples
    assert_allclose(outcome.mounting.bias, TRUE.bias, atol=0.01)
    assert_allclose(outcome.mounting.scale, TRUE.scale, atol=0.001)
    assert_allclose(outcome.mounting.rate_bias, TRUE.rate_bias, atol=1e-3)
    turned = Rotation.from_matrix(outcome.mounting.rotation @ TRUE.rotation.T).magnitude()
    assert np.degrees(turned) < 0.2  # heading from tilts of 20 degrees is three times less sure than up
    assert_allclose(outcome.mounting.position, [0.1, 0.2, 0.3])


def test_what_a_tumble_found_is_loaded_as_it_was(tmp_path):
    outcome = run_tumble(lambda attitude: READINGS[attitude.name])
    save_mounting(tmp_path / "m.toml", outcome.mounting, outcome.section)
    assert_allclose(load_mounting(tmp_path / "m.toml").rotation, outcome.mounting.rotation)


def spoilt(change):
    """A reader of a sensor whose driver changes what it reads."""
    return lambda attitude: StillReading(change(READINGS[attitude.name].force), None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda y: -y, "on its sides: wrong sign"),
        (lambda y: y[[1, 0, 2]], "on its sides: wrong axes: x reads +y, y reads +x, z reads +z"),
        (lambda y: y[[1, 2, 0]], "on its sides: wrong axes"),
        (lambda y: y / 9.80665, "seem to be in g"),
        (lambda y: y * 100.0, "seem to be in cm/s2"),
        (lambda y: y * 0.001, "takes gravity away"),
    ],
)
def test_a_driver_that_is_wrong_is_named(change, said):
    outcome = run_tumble(spoilt(change))
    assert any(said in fault for fault in outcome.faults), outcome.faults


def test_a_base_that_was_tilted_the_other_way_is_told():
    def read(attitude):
        other = attitude._replace(up=tuple(np.array(attitude.up) * [-1, 1, 1]))
        return READER(other) if attitude.name == "pitched" else READINGS[attitude.name]

    outcome = run_tumble(read)
    assert any("was it tilted as told" in fault for fault in outcome.faults), outcome.faults


def test_sides_that_were_left_out_are_named():
    def read(attitude):
        return READINGS["+z up" if attitude.name in ("-z up", "slanted 2", "slanted 3") else attitude.name]

    assert any("no reading with -z up" in fault for fault in run_tumble(read).faults)
