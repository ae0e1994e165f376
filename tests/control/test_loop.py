import gc
import os
import time
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.control.correction import SlowTorque
from catenary.control.limits import TorqueLimits
from catenary.control.loop import Tick, run_loop
from catenary.control.loop_report import LoopReport
from catenary.control.pd import JointPD
from catenary.errors import InputError, LimitError, NotReadyError, SensorError, UnsupportedCommandError
from catenary.plant import JointState, OperatingState
from catenary.sensing.gravity_vector import GravityReading, Mailbox, ReadingStatus
from catenary.sensing.imu import SensedGravity
from catenary.sensing.imu_faults import Fault
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor
from catenary.trajectories.reference import Reference, Rest
from oracles.ideal_plant import MassPlant

ZERO = np.zeros(2)
FADE = 1.5  # [s]
STIFFNESS = 100.0  # [Nm/rad]


class Swing:
    """Both joints on a sine of 1 Hz, for as long as it is told."""

    def __init__(self, duration: float) -> None:
        self.duration = duration

    def __call__(self, t: float) -> Reference:
        w = 2.0 * np.pi
        q = np.full(2, 0.1 * np.sin(w * t))
        return Reference(q, np.full(2, 0.1 * w * np.cos(w * t)), -w * w * q)


class Pushing:
    """Gives one torque always, or raises at a tick."""

    def __init__(self, tau: Floats, *, error: BaseException | None = None, at: int = 5) -> None:
        self.tau, self.error, self.at, self.ticks = tau, error, at, 0

    def torque(self, state: JointState, reference: Reference) -> Floats:
        self.ticks += 1
        if self.error is not None and self.ticks > self.at:
            raise self.error
        return self.tau.copy()


PD = JointPD([400.0, 400.0], [40.0, 40.0])


def report_of(error: BaseException) -> LoopReport:
    return error.loop_report  # type: ignore[attr-defined]


def test_pd_holds_a_mass_on_its_trajectory() -> None:
    report = run_loop(MassPlant(ZERO), PD, Swing(2.0))
    assert report.finished
    assert report.ticks == 2001  # both ends
    # stiffness 400 on a unit mass at 1 Hz: acceleration 3.9 / 400 lags behind, plus the start at rest
    assert max(report.tracking_nominal) < 0.02
    assert 0.0 < min(report.tracking_nominal)
    assert report.jitter is None  # simulated time runs as fast as it can
    assert report.overruns is None


def test_without_controller_the_references_positions_are_sent() -> None:
    plant, swing = MassPlant(ZERO), Swing(0.05)
    report = run_loop(plant, None, swing)
    sent = [values for verb, values in plant.log if verb == "servo_jp"]
    assert_array_equal(sent, [swing(k * 0.001).q for k in range(51)])
    assert plant.state.state == "ENABLED"
    assert report.tracking_calibrated is None


def test_observers_see_what_was_measured_and_sent() -> None:
    seen: list[Tick] = []
    plant = MassPlant(ZERO)
    limits = TorqueLimits([1.0, 1.0], slew=[100.0, 100.0])
    report = run_loop(plant, PD, Swing(0.2), limits=limits, observers=[seen.append])
    assert [tick.number for tick in seen] == list(range(201))
    assert_allclose([tick.time for tick in seen], 0.001 * np.arange(201), atol=1e-12)
    sent = [values for verb, values in plant.log if verb == "servo_jf"]
    assert_array_equal([tick.tau for tick in seen], sent)
    assert np.abs(sent).max() <= 1.0
    assert np.abs(np.diff(sent, axis=0)).max() <= 0.1 + 1e-12
    assert report.limited_ticks > 0


def test_limits_taper_by_the_robots_own_positions() -> None:
    plant, seen = MassPlant(np.array([0.95, 0.0])), list[Tick]()
    limits = TorqueLimits([9.0, 9.0], lower=[-1.0, -1.0], upper=[1.0, 1.0], taper=[0.1, 0.1])
    push = Pushing(np.full(2, 4.0))
    there = Rest(np.array([7.95, 7.0]), 0.0)
    run_loop(plant, push, there, limits=limits, corrector=Shift(7.0), observers=[seen.append])
    assert_allclose(seen[0].tau, [2.0, 4.0])
    assert_allclose(seen[0].state.q, there(0.0).q)


class Shift:
    """A corrector that adds a constant; the second joint is outside every other tick."""

    def __init__(self, shift: float) -> None:
        self.shift, self.rate, self.ticks = shift, 0.0, 0

    def prepare(self, joint_names: tuple[str, ...], joint_units: tuple[str, ...], rate_hz: float) -> None:
        self.rate = rate_hz

    def correct_state(self, state: JointState, out: Floats, inside: Floats, interval: Floats) -> None:
        out[:] = state.q + self.shift
        interval[:] = 0.0
        inside[:] = [True, self.ticks % 2 == 0]
        self.ticks += 1


def test_controller_sees_calibrated_positions() -> None:
    plant, corrector = MassPlant(ZERO, friction=1.0), Shift(0.02)
    report = run_loop(plant, PD, Rest(ZERO, 0.0), corrector=corrector, duration=4.0)
    assert corrector.rate == 1000.0
    assert_allclose(plant.q, [-0.02, -0.02], atol=1e-6)  # so that the calibrated position is zero
    assert report.outside_valid_range == (0.0, pytest.approx(0.5, abs=1e-3))
    assert report.tracking_calibrated is not None
    assert max(report.tracking_calibrated) < min(report.tracking_nominal)


class BehindASpring(MassPlant):
    """Motors whose joints do not move: springs to them pull back; they stretch by tau / STIFFNESS."""

    def _load(self) -> Floats:
        return STIFFNESS * self.q


class Stretch(Shift):
    """A corrector that takes off the stretch that torques tell."""

    def correct_state(self, state: JointState, out: Floats, inside: Floats, interval: Floats) -> None:
        out[:] = state.q - state.tau / STIFFNESS
        inside[:], interval[:] = True, 0.0


@pytest.mark.parametrize("gain", [2.0 * STIFFNESS, 8.0 * STIFFNESS])
def test_pd_at_positions_corrected_by_its_own_torque_is_stable(gain: float) -> None:
    plant, goal = BehindASpring(ZERO, friction=20.0), np.array([0.01, -0.02])
    pd = JointPD([gain, gain], [2.0 * np.sqrt(gain)] * 2)
    seen: list[Tick] = []
    run_loop(plant, pd, Rest(goal, 9.0), corrector=Stretch(0.0), observers=[seen.append])
    # at rest tau = STIFFNESS q, so that the corrected position is the joint's, 0, and PD asks gain * goal
    assert_allclose(seen[-1].tau, gain * goal, rtol=1e-2)
    assert_allclose(seen[-1].q_nominal, gain * goal / STIFFNESS, rtol=1e-2)


def test_slow_torques_pass_nan_on_and_forget_it() -> None:
    slow, seen = SlowTorque(0.001), np.array([1.0, np.nan])
    assert_array_equal(slow.of(seen), seen)
    for _ in range(200):  # a time constant
        last = slow.of(np.array([1.0, 2.0]))
    assert_allclose(last, [1.0, 2.0 * (1.0 - np.exp(-1.0))])


def test_a_slower_loop_lets_the_robot_take_several_of_its_ticks() -> None:
    plant = MassPlant(ZERO)
    report = run_loop(plant, PD, Swing(0.1), rate_hz=500.0)
    assert report.ticks == 51
    assert plant.time == pytest.approx(0.102)


@pytest.mark.parametrize(
    ("joints", "options", "message"),
    [
        *((2, {"rate_hz": rate}, "rate_hz") for rate in (0.0, -1.0, np.nan, np.inf, 2000.0, 700.0)),
        (3, {}, r"reference q: expected shape \(3,\), got \(2,\)"),
        (2, {"limits": TorqueLimits([1.0, 1.0, 1.0])}, "tau"),
        (2, {"duration": -1.0}, "duration"),
    ],
)
def test_what_does_not_fit_the_robot_is_refused(joints: int, options: dict[str, Any], message: str) -> None:
    plant = MassPlant(np.zeros(joints))
    with pytest.raises(InputError, match=message):
        run_loop(plant, PD, Swing(0.1), **options)
    assert plant.log == []


@pytest.mark.parametrize(
    ("state", "message"),
    [
        (OperatingState("PAUSED", True, False), "PAUSED, expected ENABLED"),
        (OperatingState("ENABLED", False, False), "not homed"),
        (OperatingState("ENABLED", True, True), "busy"),
    ],
)
def test_robots_that_are_not_ready_are_sent_nothing(state: OperatingState, message: str) -> None:
    plant = MassPlant(ZERO)
    plant.state = state
    with pytest.raises(NotReadyError, match=message):
        run_loop(plant, PD, Swing(0.1))
    assert plant.log == []


@pytest.mark.parametrize("controller", [None, PD])
def test_robots_without_the_verb_are_refused(controller: JointPD | None) -> None:
    plant = MassPlant(ZERO)
    plant.supports = frozenset({"measured_js"})
    with pytest.raises(UnsupportedCommandError, match="the robot has no servo_j"):
        run_loop(plant, controller, Swing(0.1))


@pytest.mark.parametrize("q", [[0.2, 0.0], [0.0, np.nan]])
@pytest.mark.parametrize("controller", [None, PD])
def test_robots_are_not_made_to_leap_at_the_start(q: list[float], controller: JointPD | None) -> None:
    plant = MassPlant(np.array(q))
    with pytest.raises(LimitError, match=r'joint "j[01]": the trajectory begins at 0 rad, .* go there first'):
        run_loop(plant, controller, Swing(0.1))
    assert plant.log == []


def test_a_start_that_neither_reported_nor_calibrated_positions_have_is_refused_with_both() -> None:
    plant = MassPlant(ZERO)
    with pytest.raises(LimitError, match=r"begins at 0.15 rad, the robot is at 0 rad \(0.3 rad calibrated\)"):
        run_loop(plant, PD, Rest(ZERO + 0.15, 0.1), corrector=Shift(0.3))
    assert plant.log == []


def positions_seen(start: float, corrector: Any, seconds: float = 2.0) -> tuple[Floats, Floats, Floats]:
    """Return what the controller saw, what the robot reported, and half-widths, of an arm that rests at 0."""
    seen: list[Tick] = []
    run_loop(
        MassPlant(ZERO, friction=1.0), PD, Rest(ZERO + start, seconds), corrector=corrector, observers=[seen.append]
    )
    q, nominal = (np.array(rows)[:, 0] for rows in zip(*((t.state.q, t.q_nominal) for t in seen), strict=True))
    return q, nominal, np.array([t.state.q_interval[0] for t in seen])


def test_an_arm_at_rest_does_not_jump_by_its_own_calibration() -> None:
    q, nominal, widths = positions_seen(0.0, Shift(0.3))
    assert abs(q[0]) < 1e-12
    # [rad/s]; it follows the fade, which lasts 1.5 s
    assert np.abs(np.diff(nominal)).max() / 0.001 < 1.2 * 0.3 / FADE
    assert_allclose(nominal[-1], -0.3, atol=1e-2)
    assert_allclose(q - nominal, 0.3 - widths, atol=1e-12)  # what is left out is in the half-widths
    assert widths[-1] == 0.0


def test_a_loop_that_begins_at_calibrated_positions_has_the_whole_correction_at_once() -> None:
    q, nominal, widths = positions_seen(0.3, Shift(0.3))
    assert_allclose(q - nominal, 0.3, atol=1e-12)
    assert_allclose(nominal, 0.0, atol=1e-12)
    assert (widths == 0.0).all()


class LeavesItsRange(Shift):
    """Gives 0.2 rad more while it is outside its range, from 0.5 s to 0.6 s."""

    def correct_state(self, state: JointState, out: Floats, inside: Floats, interval: Floats) -> None:
        super().correct_state(state, out, inside, interval)
        outside = 0.5 <= state.time < 0.6
        inside[:], interval[:] = not outside, 0.0
        out[0] += 0.2 * outside


def test_a_correction_that_changes_between_model_and_offset_moves_the_arm_slowly() -> None:
    q, nominal, _ = positions_seen(0.3, LeavesItsRange(0.3), 3.0)
    speed = np.abs(np.diff(nominal)).max() / 0.001
    assert 0.0 < speed < 1.2 * 0.2 / FADE
    assert np.abs(np.diff(q)).max() < 0.2 / FADE * 0.0011 + np.abs(np.diff(nominal)).max()
    assert_allclose(q[-1], 0.3, atol=1e-6)


@pytest.mark.parametrize("error", [ValueError("a mistake"), KeyboardInterrupt()])
def test_whatever_ends_the_loop_the_robot_holds_and_pauses(error: BaseException) -> None:
    plant = MassPlant(np.array([0.3, -0.3]))
    with pytest.raises(type(error)) as caught:
        run_loop(plant, Pushing(np.full(2, 5.0), error=error), Rest(plant.q, 1.0))
    assert caught.value is error
    assert [verb for verb, _ in plant.log] == ["servo_jf"] * 5 + ["servo_jp", "state_command"]
    assert_allclose(plant.q, [0.3, -0.3], atol=1e-3)
    assert plant.state.state == "PAUSED"
    report = report_of(error)
    assert (report.ticks, report.finished) == (5, False)
    assert "ended after 5 ticks" in error.__notes__[0]


def test_an_interrupt_meanwhile_is_raised_once_the_robot_is_paused(monkeypatch) -> None:
    def interrupt(q: Floats) -> None:
        raise KeyboardInterrupt

    plant = MassPlant(ZERO)
    monkeypatch.setattr(plant, "servo_jp", interrupt)
    with pytest.raises(KeyboardInterrupt) as caught:
        run_loop(plant, Pushing(ZERO, error=ValueError("a mistake")), Swing(1.0))
    assert plant.state.state == "PAUSED"
    assert isinstance(caught.value.__cause__, ValueError)
    assert report_of(caught.value.__cause__).ticks == 5


def test_a_robot_that_stops_by_itself_ends_the_loop() -> None:
    plant = MassPlant(ZERO)

    def emergency_stop(tick: Tick) -> None:
        if tick.number == 7:
            plant.state = OperatingState("FAULT", True, False)

    with pytest.raises(NotReadyError) as caught:
        run_loop(plant, PD, Swing(1.0), observers=[emergency_stop])
    assert report_of(caught.value).ticks == 8
    assert any("holding the robot failed" in note for note in caught.value.__notes__)


@pytest.mark.parametrize(
    ("supports", "last", "state"),
    [({"servo_jp", "servo_jf"}, "servo_jp", "ENABLED"), ({"servo_jf"}, "state_command", "PAUSED")],
)
def test_at_the_end_of_torque_control_the_robot_holds_or_is_paused(supports, last, state) -> None:
    plant = MassPlant(ZERO)
    plant.supports = frozenset(supports)
    run_loop(plant, PD, Swing(0.1))
    assert plant.log[-1][0] == last
    assert_array_equal(plant.tau, ZERO)
    assert plant.state.state == state


@pytest.mark.parametrize("simulated", [True, False])
def test_real_time_is_kept_where_it_is_asked_for_or_real(simulated: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gc, "collect", lambda: 0)  # which takes seconds here
    gc.unfreeze()  # what conftest.py froze: the loop freezes where nobody else has
    before = disturbances()
    collecting: list[bool] = []
    begin = time.perf_counter()
    report = run_loop(
        MassPlant(ZERO, simulated=simulated),
        PD,
        Swing(0.2),
        real_time=simulated,
        observers=[lambda tick: collecting.append(gc.isenabled())],
    )
    assert time.perf_counter() - begin >= 0.2
    assert not any(collecting)
    assert disturbances() == before
    assert report.compute is not None
    assert report.jitter is not None
    assert report.overruns is not None
    assert 0.0 < report.compute.median <= report.compute.p99 <= report.compute.max
    assert "period jitter" in str(report)
    with pytest.raises(ValueError, match="a mistake"):
        run_loop(MassPlant(ZERO, simulated=False), Pushing(ZERO, error=ValueError("a mistake")), Swing(1.0))
    assert disturbances() == before
    gc.freeze()


def disturbances() -> tuple[bool, int, int]:
    """What real time changes in a process: garbage collection on, objects frozen, scheduling policy."""
    return gc.isenabled(), gc.get_freeze_count(), os.sched_getscheduler(0)


def test_late_ticks_are_counted_and_delay_the_motion() -> None:
    seen: list[float] = []

    def slow(tick: Tick) -> None:
        seen.append(tick.time)
        if tick.number in (10, 20):
            time.sleep(0.01)

    report = run_loop(MassPlant(ZERO, simulated=False), PD, Swing(0.05), observers=[slow])
    assert report.overruns is not None
    assert report.overruns >= 2
    assert_allclose(np.diff(seen), 0.001, atol=1e-12)
    assert report.compute is not None
    assert report.compute.max > 0.01


class Scripted:
    """A source that says what a test tells it to, tick by tick."""

    def __init__(self, statuses: list[ReadingStatus], faults: list[Fault]) -> None:
        self.script = list(zip(statuses, faults, strict=True))
        self.times: list[float] = []

    def read(self, time: float) -> GravityReading:
        status, faults = self.script[len(self.times)]
        self.times.append(time)
        return GravityReading(np.full(3, time), 0.001 * len(self.times), np.full((2, 3), -time), status, faults)


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
    run_loop(MassPlant(ZERO), Watching(), Rest(ZERO, 0.01), gravity=source)
    assert_allclose(source.times, np.arange(11) * 0.001)
    for state, at in zip(seen, source.times, strict=True):
        assert state.time == at
        assert_array_equal(state.gravity, np.full(3, at))
        assert_array_equal(state.base_rates, np.full((2, 3), -at))
        assert state.gravity_age == pytest.approx(at + 0.001)


def test_a_run_reports_ticks_by_status_and_fault_and_what_they_mean():
    both = Fault.STUCK | Fault.INTERRUPTED
    statuses = [ReadingStatus.NOMINAL] * 2 + [ReadingStatus.LIVE] * 5 + [ReadingStatus.STALE] * 4
    source = Scripted(statuses, [Fault.NOTHING_RECEIVED] * 2 + [Fault.NONE] * 5 + [Fault.STUCK] + [both] * 3)
    report = run_loop(MassPlant(ZERO), PD, Rest(ZERO, 0.01), gravity=source)
    assert report.gravity is not None
    assert report.gravity.ticks == {"nominal": 2, "live": 5, "stale": 4}
    assert report.gravity.faults == {"nothing_received": 2, "stuck": 4, "interrupted": 3}
    assert report.gravity.messages == (Fault.NOTHING_RECEIVED.message, Fault.STUCK.message, Fault.INTERRUPTED.message)
    assert report.gravity.largest_age == pytest.approx(0.011)
    assert "gravity: stuck in 4 ticks: the accelerometer repeats" in str(report)


def test_a_lost_sensor_stops_the_robot_safely_where_that_is_asked_for():
    plant = MassPlant(ZERO)
    lost = sensed(InjectedFault("drop_out", 0.5), fallback="stop")
    with pytest.raises(SensorError, match="gravity is not known: samples stopped coming") as caught:
        run_loop(plant, PD, Rest(ZERO, 2.0), gravity=lost)
    assert plant.state.state == "PAUSED"
    assert [verb for verb, _ in plant.log][-2:] == ["servo_jp", "state_command"]
    report = report_of(caught.value)
    assert report.ticks == pytest.approx(696, abs=2)  # 495 ms, the last sample, and the age limit of 200 ms
    assert report.gravity.ticks["stop"] == 1
