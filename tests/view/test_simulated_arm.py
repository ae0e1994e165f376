"""A simulated arm driven as from the page, without one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.control.controllers import CONTROLLERS
from catenary.monitor import Snapshot
from catenary.plant import JointState
from catenary.sensing.gravity_vector import ReadingStatus
from catenary.simulation.base_motion import _CHANGE_TIME_S, SteeredBase
from catenary.trajectories.smoothed_path import go_to
from catenary.view.page_content import Change
from catenary.view.simulated_arm import (
    _GO_TO,
    _OWN_CONTROL,
    _SENSOR_FAULTS,
    DrivenArm,
    SteeredTrajectory,
    Surroundings,
    SwitchedCorrector,
)
from catenary.workflows.gravity_trials import simulated_arm


class Script:
    """A page on which somebody does one thing after the other, each some seconds of the robot's time after the last."""

    def __init__(self, *steps: tuple[float, str, object]) -> None:
        self._steps, self._at = list(steps), 0.0
        self.states: list[Snapshot] = []
        self.is_running = True

    def put(self, state: Snapshot, values: dict[str, object]) -> None:
        self.states.append(state)
        self.values = values
        if not self._steps and state.time - self._since >= self._at:
            self.is_running = False

    def changes(self) -> list[Change]:
        if not self.states:
            return []
        now = self.states[-1].time
        if self._at == 0.0:
            self._since = now
            self._at = 1e-9
        if self._steps and now - self._since >= self._steps[0][0]:
            _, name, value = self._steps.pop(0)
            self._since, self._at = now, 0.3
            return [] if name == "" else [Change(name, value)]
        return []


def drive(arm: DrivenArm, *steps: tuple[float, str, object]) -> list[Snapshot]:
    return driven(arm, *steps).states


def driven(arm: DrivenArm, *steps: tuple[float, str, object]) -> Script:
    # whoever leaves the page leaves the arm paused
    page = Script((0.0, "level", "enable"), *steps)
    arm.run(page)
    return page


@pytest.fixture(scope="module")
def raven() -> DrivenArm:
    return DrivenArm("raven2", rng=np.random.default_rng(1), real_time=False)


@pytest.mark.slow
def test_arm_moves_by_itself_and_goes_where_the_sliders_are(raven: DrivenArm) -> None:
    page = driven(raven, (2.0, "goto:shoulder", 45.0), (0.1, "goto:elbow", 80.0), (6.0, "", None))
    states = page.states
    q = np.array([state.q for state in states])
    assert np.ptp(q[:40], axis=0).max() > 0.01  # within the first two seconds
    assert_allclose(np.rad2deg(states[-1].q[:2]), [45.0, 80.0], atol=0.5)
    assert page.values["motion"] == _GO_TO
    assert "ENABLED, homed" in states[-1].state


@pytest.mark.slow
def test_tilted_base_is_compensated_by_sensed_gravity_and_not_by_that_of_a_level_base(raven: DrivenArm) -> None:
    rest, tilt = (0.1, "motion", "rest"), (0.1, "roll_deg", 60.0)
    shares = {}
    for key in ("sg", "dg"):
        states = drive(raven, (0.1, "controller", CONTROLLERS[key].words), rest, tilt, (3.0, "", None))
        last = states[-1]
        assert_allclose(last.actual[1], -9.81 * np.sin(np.pi / 3.0), rtol=1e-6)
        shares[key] = np.abs(last.feedback[0])
        drive(raven, (0.1, "roll_deg", 0.0), (2.0, "", None))
    assert shares["sg"] > 3.0 * shares["dg"]  # what gravity of a level base leaves to PD


def test_pause_holds_the_arm_and_enable_lets_it_go_on(raven: DrivenArm) -> None:
    states = drive(
        raven, (0.1, "motion", "random motion"), (1.0, "level", "pause"), (0.5, "level", "enable"), (1.0, "", None)
    )
    modes = [state.state for state in states]
    assert any(mode.startswith("PAUSED") for mode in modes)
    assert modes[-1].startswith("ENABLED, homed")
    paused = np.array([state.q for state in states if state.state.startswith("PAUSED")])[2:]
    assert np.ptp(paused, axis=0).max() < 2e-3  # the cables give a little


@pytest.mark.slow
def test_home_takes_the_arm_to_its_stops_and_back_into_the_loop(raven: DrivenArm) -> None:
    states = drive(raven, (0.1, "level", "home"), (25.0, "", None))
    modes = [state.state for state in states]
    assert any("busy" in mode for mode in modes)
    assert modes[-1].startswith("ENABLED, homed")


def test_robots_own_control_takes_over_and_gives_back(raven: DrivenArm) -> None:
    states = drive(raven, (0.2, "controller", _OWN_CONTROL), (1.0, "controller", "PD alone"), (1.0, "", None))
    assert states[-1].state.startswith("ENABLED, homed")
    assert not any("FAULT" in state.state for state in states)


def test_gravity_compensation_alone_tracks_no_setpoint(raven: DrivenArm) -> None:
    states = drive(raven, (0.2, "controller", "gravity compensation alone"), (1.0, "", None))
    assert states[-1].setpoint is None
    assert_allclose(states[-1].feedback, 0.0)
    assert not any("FAULT" in state.state for state in states)
    drive(raven, (0.1, "controller", "PD + sensed gravity (DG)"))


def test_page_says_why_the_arm_is_in_fault() -> None:
    arm = DrivenArm("raven2", rng=np.random.default_rng(1), real_time=False)
    states = drive(arm, (0.1, "payload_kg", 1e5), (0.5, "", None))  # which no slider tells
    assert states[-1].state.startswith("FAULT")
    assert any(
        "in FAULT: the software e-stop tripped at" in warning and "a motor's command was too large" in warning
        for warning in states[-1].warnings()
    )


def test_shown_arm_has_a_slider_for_each_joint_within_its_limits(raven: DrivenArm) -> None:
    shown = raven.shown("x")
    sliders = [c for tab in shown.tabs for c in tab.controls if c.name.startswith("goto:")]
    assert [c.name for c in sliders] == ["goto:shoulder", "goto:elbow", "goto:insertion"]
    assert all(c.options[0] <= c.value <= c.options[1] for c in sliders)
    assert set(shown.legend) == {"reported", "true"}


DT = 1e-3
FADE = 1.5  # [s]


def way(goal: np.ndarray):
    return lambda q: go_to(q, goal, max_velocity=[0.5, 0.5], max_acceleration=[1.0, 1.0])


@settings(max_examples=3, deadline=None)
@given(st.lists(st.tuples(st.floats(0.05, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=5))
def test_motion_is_continuous_however_often_another_is_wanted(wishes) -> None:
    trajectory = SteeredTrajectory(np.zeros(2))
    rows, t = [], 0.0
    for wait, a, b in wishes:
        trajectory.follow(way(np.array([a, b])))
        for _ in range(round(wait / DT)):
            t += DT
            rows.append(trajectory(t))
    for _ in range(5500):
        t += DT
        rows.append(trajectory(t))
    q, qd = np.array([row.q for row in rows]), np.array([row.qd for row in rows])
    assert np.abs(np.diff(q, axis=0)).max() <= 0.51 * DT
    # stopping in 0.4 s from 0.5 rad/s beside the motion's own 1 rad/s2, as a go-to may ask for
    assert np.abs(np.diff(qd, axis=0)).max() <= 4.0 * DT
    assert_allclose(np.diff(q, axis=0) / DT, 0.5 * (qd[1:] + qd[:-1]), atol=5e-3)  # qd is q's derivative
    assert_allclose(q[-1], wishes[-1][1:], atol=1e-9)
    assert_allclose(qd[-1], 0.0, atol=1e-9)


def test_motion_that_is_over_is_made_again_from_where_it_ended() -> None:
    starts = []

    def recipe(q):
        starts.append(q)
        return go_to(q, q + 0.1, max_velocity=[0.5, 0.5], max_acceleration=[1.0, 1.0])

    trajectory = SteeredTrajectory(np.zeros(2))
    trajectory.follow(recipe)
    for k in range(3000):
        trajectory(k * DT)
    assert len(starts) > 2
    assert_allclose(np.diff(starts, axis=0), 0.1)
    trajectory.follow(None)
    for k in range(3000, 6000):
        last = trajectory(k * DT)
    assert_allclose(last.qd, 0.0)
    assert len(starts) < 8


class Shifted:
    """Says that every joint is 0.1 further."""

    def correct_state(self, state, out, inside, interval=None) -> None:
        out[:], inside[:] = state.q + 0.1, True
        interval[:] = 0.01

    def prepare(self, joint_names, joint_units, rate_hz) -> None: ...


def test_model_is_faded_in_and_out_and_always_says_its_own() -> None:
    corrector = SwitchedCorrector(Shifted(), lambda state: state, 2, DT)
    state = JointState(0.0, np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(0), np.zeros(3), 0.0)
    out, inside, interval = np.empty(2), np.empty(2, dtype=bool), np.empty(2)
    seen = []
    for k in range(5000):
        corrector.is_on = 100 <= k < 2500
        corrector.correct_state(state, out, inside, interval)
        assert_allclose(corrector.calibrated, 0.1)
        seen.append(out[0])
    assert seen[99] == 0.0
    assert seen[2499] == pytest.approx(0.1)
    assert seen[-1] == 0.0
    assert np.abs(np.diff(seen)).max() <= 0.1 * DT / FADE + 1e-12


@pytest.fixture(scope="module")
def world() -> Surroundings:
    return Surroundings(simulated_arm("raven2", base=SteeredBase()))


def run(world: Surroundings, seconds: float) -> None:
    for _ in range(round(seconds / world.plant.period)):
        world.plant.wait()
        world.read(world.plant.time)


def test_sensor_follows_the_base_that_is_tilted(world: Surroundings) -> None:
    world.changes()["roll_deg"](40.0)
    run(world, _CHANGE_TIME_S + 0.5)
    roll = np.deg2rad(40.0)
    assert_allclose(world.actual(), 9.81 * np.array([0.0, -np.sin(roll), -np.cos(roll)]), atol=1e-9)
    assert world.reading is not None
    assert_allclose(world.reading.gravity, world.actual(), atol=0.1)  # noise of a cheap sensor
    assert world.warnings() == ()
    world.changes()["roll_deg"](0.0)
    run(world, _CHANGE_TIME_S + 0.5)


@pytest.mark.parametrize(
    ("fault", "message"), [("unplugged", "samples stopped coming"), ("stuck", "repeats one reading")]
)
def test_broken_sensor_is_told_in_words_and_mends(world: Surroundings, fault: str, message: str) -> None:
    world.changes()["sensor"](fault)
    run(world, 0.6)
    assert message in " ".join(world.warnings())
    world.changes()["sensor"]("none")
    run(world, 1.5)
    assert world.warnings() == ()
    assert world.reading is not None
    assert world.reading.status is ReadingStatus.LIVE


def test_every_fault_on_the_page_can_be_set(world: Surroundings) -> None:
    for fault in _SENSOR_FAULTS:
        world.changes()["sensor"](fault)
    world.changes()["sensor"]("none")


@pytest.mark.parametrize(("name", "value"), [("payload_kg", 0.5), ("friction", 2.0), ("wear", 0.5)])
def test_cables_and_payload_change_what_the_arm_does(world: Surroundings, name: str, value: float) -> None:
    plant = world.plant
    before = plant.state.q.copy()
    world.changes()[name](value)
    run(world, 0.3)
    changed = np.abs(plant.state.q - before).max()
    world.changes()[name](1.0 if name == "friction" else 0.0)
    run(world, 0.3)
    # friction alone lets an arm at rest rest
    assert changed > 1e-5 or name == "friction"
