import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.control.loop import Tick, run_loop
from catenary.control.pd import JointPD
from catenary.errors import SensorError
from catenary.plant import JointState
from catenary.sensing.faults import Fault
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mailbox import Mailbox
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import FixedGravity, GravityReading, ReadingStatus
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor
from catenary.trajectories.in_turn import Rest
from oracles.ideal_plant import MassPlant

PD = JointPD([400.0, 400.0], [40.0, 40.0])


def still(duration: float) -> Rest:
    return Rest(np.zeros(2), duration)


class Scripted:
    """A source that says what a test tells it to, tick by tick."""

    def __init__(self, statuses: list[ReadingStatus], faults: list[Fault]) -> None:
        self.script = list(zip(statuses, faults, strict=True))
        self.times: list[float] = []

    def read(self, time: float) -> GravityReading:
        status, faults = self.script[len(self.times)]
        self.times.append(time)
        return GravityReading(
            np.full(3, time), 0.001 * len(self.times), np.full((2, 3), -time), status, faults
        )


def sensed(*faults: InjectedFault, fallback: str = "fade") -> SensedGravity:
    mailbox = Mailbox()
    sensor = SimulatedSensor(FixedBase(0.3, 0.1), mailbox, SensorModel(), faults=faults)
    return SensedGravity(mailbox, Mounting(), fallback=fallback, feed=sensor.advance)


def test_the_states_gravity_is_what_the_source_says_at_the_states_time():
    seen: list[JointState] = []

    class Watching:
        def torque(self, state, reference):
            seen.append(state)
            return np.zeros(2)

    source = Scripted([ReadingStatus.LIVE] * 11, [Fault.NONE] * 11)
    run_loop(MassPlant(np.zeros(2)), Watching(), still(0.01), gravity=source)
    assert_allclose(source.times, np.arange(11) * 0.001)
    for state, time in zip(seen, source.times, strict=True):
        assert state.time == time
        assert_array_equal(state.gravity, np.full(3, time))
        assert_array_equal(state.base_rates, np.full((2, 3), -time))
        assert state.gravity_age == pytest.approx(time + 0.001)


def test_without_a_source_the_robots_own_report_stands():
    seen: list[Tick] = []
    report = run_loop(MassPlant(np.zeros(2)), PD, still(0.01), observers=[seen.append])
    assert_array_equal(seen[-1].state.gravity, [0.0, 0.0, -9.81])
    assert report.gravity is None


def test_a_run_reports_ticks_by_status_and_fault_and_what_they_mean():
    both = Fault.STUCK | Fault.INTERRUPTED
    statuses = [ReadingStatus.NOMINAL] * 2 + [ReadingStatus.LIVE] * 5 + [ReadingStatus.STALE] * 4
    source = Scripted(statuses, [Fault.NOTHING_RECEIVED] * 2 + [Fault.NONE] * 5 + [Fault.STUCK] + [both] * 3)
    report = run_loop(MassPlant(np.zeros(2)), PD, still(0.01), gravity=source)
    assert report.gravity is not None
    assert report.gravity.ticks == {"nominal": 2, "live": 5, "stale": 4}
    assert report.gravity.faults == {"nothing_received": 2, "stuck": 4, "interrupted": 3}
    assert report.gravity.messages == (
        Fault.NOTHING_RECEIVED.message,
        Fault.STUCK.message,
        Fault.INTERRUPTED.message,
    )
    assert report.gravity.largest_age == pytest.approx(0.011)
    assert "gravity: stuck in 4 ticks: the accelerometer repeats" in str(report)


def test_a_simulated_sensor_serves_a_loop_and_a_fixed_vector_has_no_age():
    served, fixed = (
        run_loop(MassPlant(np.zeros(2)), PD, still(1.0), gravity=source).gravity
        for source in (sensed(), FixedGravity())
    )
    assert served is not None
    assert served.ticks["live"] > 950
    assert served.faults == {}
    assert fixed is not None
    assert math.isnan(fixed.largest_age)


def test_a_lost_sensor_stops_the_robot_safely_where_that_is_asked_for():
    plant = MassPlant(np.zeros(2))
    lost = sensed(InjectedFault("drop_out", 0.5), fallback="stop")
    with pytest.raises(SensorError, match="gravity is not known: samples stopped coming") as caught:
        run_loop(plant, PD, still(2.0), gravity=lost)
    assert plant.state.state == "PAUSED"
    assert [verb for verb, _ in plant.log][-2:] == ["servo_jp", "state_command"]
    report = caught.value.loop_report  # type: ignore[attr-defined]
    assert report.ticks == pytest.approx(696, abs=2)  # 495 ms, the last sample, and the age limit of 200 ms
    assert report.gravity.ticks["stop"] == 1


@pytest.mark.parametrize("fallback", ["hold", "fade", "static"])
def test_a_lost_sensor_stops_nothing_otherwise(fallback):
    lost = sensed(InjectedFault("drop_out", 0.5), fallback=fallback)
    report = run_loop(MassPlant(np.zeros(2)), PD, still(1.0), gravity=lost)
    assert report.finished
    assert report.gravity is not None
    assert report.gravity.faults["interrupted"] > 400
