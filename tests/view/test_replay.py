from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration import calibration
from catenary.calibration.model_file import load_model
from catenary.dvrk_psm import PSM_JOINTS
from catenary.errors import ConfigError, InputError
from catenary.gravity.torque import gravity_torque
from catenary.monitor import Snapshot
from catenary.open_robot import Simulated, tilted_base
from catenary.plant import MotionLog
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from catenary.view.meshes import arm_shapes
from catenary.view.page_content import Change
from catenary.view.replay import RecordedArm, Replay, WatchedArm, recorded_arm, shown_project
from catenary.workflows.project.folder import Project, ProjectSettings, is_project
from catenary.workflows.robot.operated_robot import operated_robot
from view.arms import RAVEN

ROWS, WORST = 600, 417


def log(**changes: object) -> MotionLog:
    """A minute at 10 Hz whose elbow is 2 deg off, 5 deg on one row; the first rows are without truth."""
    time = 0.1 * np.arange(ROWS)
    q = np.column_stack([0.7 + 0.1 * np.sin(time), 1.5 + 0.1 * np.cos(0.7 * time), 0.4 + 0.01 * np.sin(2.0 * time)])
    true = q.copy()
    true[:, 1] -= np.deg2rad(2.0)
    true[WORST, 1] -= np.deg2rad(3.0)
    ok = np.ones(ROWS, dtype=bool)
    ok[:5] = False
    values = {"time": time, "tau": np.ones((ROWS, 3)), "q_encoder": true, "ok": ok} | changes
    return MotionLog("a minute", RAVEN.joint_names, RAVEN.joint_units, q, **values)  # type: ignore[arg-type]


def test_rows_are_the_recordings_and_gravity_is_what_holds_the_arm() -> None:
    recording = log()
    arm = recorded_arm(recording, RAVEN)
    assert np.isnan(arm.state(2).true).all()  # nobody measured it there
    assert "no truth on this row" in arm.state(2).warnings()
    state = arm.state(100)
    assert_allclose(state.q, recording.q_nominal[100])
    assert_allclose(np.rad2deg(state.q[1] - state.true[1]), 2.0)
    assert_allclose(state.gravity_tau, gravity_torque(RAVEN, state.q, LEVEL))
    assert np.isnan(state.calibrated).all()
    assert arm.worst_row(1) == WORST


def test_calibrated_rows_are_the_models_with_its_intervals(tmp_path: Path) -> None:
    recording = log()
    calibration.fit(recording, model="offset", accept=["copied"]).save(tmp_path / "offset.npz")
    model, _ = load_model(tmp_path / "offset.npz")
    arm = recorded_arm(recording, RAVEN, model)
    assert_allclose(arm.rows["calibrated"], model.calibrate(recording))
    assert_allclose(arm.rows["interval"], model.half_widths(recording))
    error = arm.rows["calibrated"] - arm.rows["true"]
    assert abs(np.rad2deg(np.nanmedian(error[:, 1]))) < 0.1


def test_recording_of_a_part_of_the_joints_leaves_the_others_at_zero() -> None:
    whole = load_robot("raven2_full")
    arm = recorded_arm(log(), whole)
    assert_allclose(arm.rows["q"][:, 3:], 0.0)
    assert arm.joints == (0, 1, 2)
    assert np.isfinite(arm.state(100).true).all()


@pytest.mark.parametrize(
    ("recording", "robot", "message"),
    [(log(time=None), "raven2", "has no time"), (log(), "ur5e", "name the robot that it is of")],
)
def test_recording_that_cannot_be_shown_is_refused(recording: MotionLog, robot: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        recorded_arm(recording, load_robot(robot))


def test_curves_are_thinned_and_hold_the_whole_recording() -> None:
    time = 0.001 * np.arange(ROWS)  # 1 kHz
    columns = recorded_arm(log(time=time), RAVEN).columns()
    assert len(columns["time"]) == 6
    assert columns["time"][-1] >= time[-1] - 0.1


class Player:
    """A page on which somebody does things at times of a clock that is the test's."""

    def __init__(self, arm: RecordedArm, *steps: tuple[float, str, object], seconds: float) -> None:
        self.now, self._steps, self._end = 0.0, list(steps), seconds
        self.states, self.values = list[Snapshot](), dict[str, object]()
        self.is_running = True
        Replay(arm).run(self, lambda: self.now > self._end, clock=lambda: self.now, sleep=self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def put(self, state: Snapshot, values: dict[str, object]) -> None:
        self.states.append(state)
        self.values = values

    def changes(self) -> list[Change]:
        due = [Change(name, value) for time, name, value in self._steps if time <= self.now]  # type: ignore[arg-type]
        self._steps = [step for step in self._steps if step[0] > self.now]
        return due


def test_recording_is_played_in_its_own_time_and_faster() -> None:
    arm = recorded_arm(log(), RAVEN)
    assert_allclose(Player(arm, seconds=10.0).states[-1].time, 10.0, atol=0.2)
    assert_allclose(Player(arm, (0.0, "speed", "4"), seconds=10.0).states[-1].time, 40.0, atol=0.5)


def test_recording_is_scrubbed_stopped_and_taken_to_its_largest_error() -> None:
    arm = recorded_arm(log(), RAVEN)
    player = Player(arm, (1.0, "plays", False), (2.0, "time", 30.0), (4.0, "worst", "elbow"), seconds=6.0)
    states = player.states
    by_time = {round(0.04 * k, 2): state for k, state in enumerate(states)}
    assert by_time[1.8].time == by_time[1.2].time
    assert by_time[3.0].time == pytest.approx(30.0)
    assert states[-1].time == pytest.approx(0.1 * WORST)
    assert np.rad2deg(states[-1].q[1] - states[-1].true[1]) == pytest.approx(5.0)
    assert player.values["plays"] is False


def test_recording_begins_again_at_its_end() -> None:
    states = Player(recorded_arm(log(), RAVEN), (0.0, "time", 59.0), seconds=3.0).states
    assert states[-1].time < 5.0


def test_page_has_a_time_line_as_long_as_the_recording() -> None:
    shown = Replay(recorded_arm(log(), RAVEN)).shown("x")
    (line,) = [c for tab in shown.tabs for c in tab.controls if c.name == "time"]
    assert line.options[1] >= 59.9
    assert set(shown.legend) == {"reported", "true"}
    assert shown.recording is not None


def test_project_shows_its_test_and_its_recommended_model_as_soon_as_they_are_there(tmp_path: Path) -> None:
    folder = Project(tmp_path / "one", ProjectSettings(side="right")).folder
    assert is_project(folder)
    assert not is_project(tmp_path)
    with pytest.raises(ConfigError, match="holds no motion log yet"):
        shown_project(folder)
    (folder / "train.parquet").touch()
    assert shown_project(folder) == (folder / "train.parquet", None, "raven2_right")
    (folder / "test.parquet").touch()
    (folder / "models").mkdir()
    (folder / "models" / "recommended.npz").touch()
    assert shown_project(folder) == (folder / "test.parquet", folder / "models" / "recommended.npz", "raven2_right")


def test_a_psms_project_is_shown_in_the_joints_that_it_reports(tmp_path: Path) -> None:
    folder = Project(tmp_path / "psm", ProjectSettings(robot="dvrk_psm")).folder
    (folder / "train.parquet").touch()
    assert load_robot(str(shown_project(folder)[2])).joint_names == PSM_JOINTS


class Glance:
    """A page that is looked at for a few states, on which somebody tries to drive the robot."""

    def __init__(self, states: int) -> None:
        self._most, self.states = states, list[Snapshot]()

    @property
    def is_running(self) -> bool:
        return len(self.states) < self._most

    def put(self, state: Snapshot) -> None:
        self.states.append(state)

    def changes(self) -> list[Change]:
        return [Change("goto:shoulder", 60.0), Change("level", "pause")]


def test_robot_is_shown_and_never_moved() -> None:
    robot = operated_robot("raven2", Simulated(base=tilted_base((30.0, 0.0))))
    before = robot.plant.measured_js().q.copy()
    watched, page = WatchedArm(robot, arm_shapes(robot.model)), Glance(5)
    assert watched.shown("x").tabs == ()
    watched.run(page)
    assert len(page.states) == 5
    last = page.states[-1]
    assert_allclose(last.q[:3], before[:3], atol=1e-3)
    assert_allclose(last.gravity, [0.0, -9.81 * np.sin(np.pi / 6.0), -9.81 * np.cos(np.pi / 6.0)], atol=1e-6)
    assert last.state == "ENABLED, homed"
    assert np.isfinite(last.true[:3]).all()
