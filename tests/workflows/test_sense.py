import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError, SensorError
from catenary.sensing.gravity_vector import Mailbox, tilted_gravity
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import FixedBase, RockingBase
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor
from catenary.workflows.sense import read_still, simulated_feed, watch


def feed(base, *faults):
    return simulated_feed(SimulatedSensor(base, Mailbox(), SensorModel(), faults=faults, seed=2))


def watched(base, seconds, *faults, **options):
    """What is said of a sensor that was watched for some seconds."""
    source_feed = feed(base, *faults)
    return watch(source_feed, SensedGravity(source_feed.mailbox), seconds, **options)


def test_a_summary_says_what_was_measured():
    summary = watched(FixedBase(0.3, -0.2), 3.0)
    assert summary.was_live
    assert set(summary.gravity.ticks) == {"live"}
    assert summary.gravity.faults == {}
    assert_allclose(summary.mean, tilted_gravity(0.3, -0.2), atol=0.01)  # noise of 0.04 over 600 samples
    assert (summary.spread < 0.06).all()
    data = summary.as_data()
    assert data["tilt_deg"]["roll"] == pytest.approx(np.degrees(0.3), abs=0.7)
    assert data["tilt_deg"]["pitch"] == pytest.approx(np.degrees(-0.2), abs=0.7)


def test_a_summary_names_what_was_wrong():
    summary = watched(FixedBase(), 2.0, InjectedFault("unit_g", 1.0))
    assert summary.gravity.faults["unit_g"] > 100
    assert any("in g, not m/s2" in message for message in summary.gravity.messages)


def test_a_sensor_that_never_can_be_believed_is_not_live():
    summary = watched(FixedBase(), 0.5, InjectedFault("gravity_stripped", 0.0))
    assert not summary.was_live
    assert np.isnan(summary.mean).all()


def test_ctrl_c_sums_up():
    def interrupt(reading, time):
        if time >= 0.5:
            raise KeyboardInterrupt

    summary = watched(FixedBase(), np.inf, show=interrupt)
    assert summary.duration == pytest.approx(0.5)
    assert summary.was_live


def test_no_time_is_refused():
    with pytest.raises(InputError, match="duration"):
        watched(FixedBase(), 0.0)


def test_a_sensor_at_rest_gives_its_means():
    reading = read_still(feed(FixedBase(0.2, 0.1)))
    assert_allclose(reading.force, -tilted_gravity(0.2, 0.1), atol=0.02)
    assert_allclose(reading.rate, 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("base", "faults", "said"),
    [
        (RockingBase(0.0, 0.3, 1.0), (), r"did not stand still within 3 s: its readings vary by [0-9.]+ m/s2"),
        (FixedBase(), (InjectedFault("drop_out", 0.0),), "no samples within 3 s"),
    ],
)  # fmt: skip
def test_a_sensor_that_moves_or_says_nothing_is_refused(base, faults, said):
    with pytest.raises(SensorError, match=said):
        read_still(feed(base, *faults), patience=3.0)
