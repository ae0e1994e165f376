from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from catenary.cli.exit_codes import EndedBySignal
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import FileFormatError, InputError, LimitError, TransportError
from catenary.open_robot import Simulated
from catenary.plant import MotionLog, nameless
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER, zigzag, zigzag_rows
from catenary.workflows.robot import operator_motion
from catenary.workflows.robot.motion import check_motion
from catenary.workflows.robot.operated_robot import operated_robot
from catenary.workflows.robot.operator_motion import (
    along_rows,
    follow_motion,
    go_to_joints,
    joints_at,
    random_motion,
    read_followed_file,
)
from oracles.ideal_plant import IdealPlant, ideal_robot

START = np.array([0.52, 1.57, 0.40])


def file_of(q: object, time: object, units: tuple[str, ...] = ("rad",), names: tuple[str, ...] = ()) -> MotionLog:
    rows = np.array(q, dtype=float)
    times, ok = np.array(time, dtype=float), np.ones(len(rows), dtype=bool)
    return MotionLog("run.csv", names or nameless(len(units)), units, rows, ok, time=times, units_assumed=not names)


class StoppedPlant(IdealPlant):
    """Something stops its motion in its 100th tick, and may stop what comes then, too."""

    stops: tuple[BaseException, ...] = (KeyboardInterrupt(),)

    def wait(self) -> None:
        super().wait()
        if 0 <= self.ticks - 100 < len(self.stops):
            raise self.stops[self.ticks - 100]


@pytest.mark.parametrize("side", ["raven2", "raven2_right"])
def test_the_tool_of_a_raven_arrives_where_it_was_sent_not_its_wrist(side: str) -> None:
    robot = operated_robot(side, Simulated(), real_time=False)
    q = robot.plant.setpoint_js().q
    goal = robot.tool_position(q) + np.array([0.004, -0.006, 0.005])
    found = joints_at(robot, goal, rng=np.random.default_rng(0))
    full, half = load_robot(side.replace("raven2", "raven2_full")), 0.5 * (q[6] - q[5])
    all_joints = np.concatenate([found, q[3:5], [half]])
    assert_allclose(forward_kinematics(full, all_joints).position, goal, atol=2e-7)
    wrist = forward_kinematics(robot.model, found).position
    assert np.linalg.norm(wrist - goal) == pytest.approx(0.013, abs=1e-4)  # from the wrist's axis to the tool


@pytest.mark.parametrize(("stop", "name"), [(KeyboardInterrupt(), "Ctrl-C"), (EndedBySignal("SIGHUP"), "SIGHUP")])
def test_ctrl_c_and_signals_hold_the_robot_where_it_is_and_pause_it(
    monkeypatch: pytest.MonkeyPatch, stop: BaseException, name: str
) -> None:
    monkeypatch.setattr(StoppedPlant, "stops", (stop,))
    robot = ideal_robot(START, kind=StoppedPlant)
    plant = robot.plant
    summary = go_to_joints(robot, [1.0])
    assert summary.ended_by == name
    assert summary.state.state == plant.operating_state().state == "PAUSED"
    assert_allclose(np.diff(plant.setpoints[-10:], axis=0), 0.0)
    assert START[0] < summary.q[0] < 1.0


@pytest.mark.parametrize(
    ("stops", "error"),
    [
        ((ValueError("a mistake"),), ValueError),
        ((TransportError("silent"), TransportError("silent")), TransportError),
        ((KeyboardInterrupt(), KeyboardInterrupt()), KeyboardInterrupt),
    ],
)
def test_whatever_ends_a_motion_the_robot_is_paused(
    monkeypatch: pytest.MonkeyPatch, stops: tuple[BaseException, ...], error: type[BaseException]
) -> None:
    monkeypatch.setattr(StoppedPlant, "stops", stops)
    robot = ideal_robot(START, kind=StoppedPlant)
    with pytest.raises(error) as caught:
        go_to_joints(robot, [1.0])
    assert robot.plant.operating_state().state == "PAUSED"
    told = getattr(caught.value, "__notes__", [])
    assert ["holding the robot failed" in note for note in told] == [True] * (len(stops) - 1)
    assert not any("TransportError(" in note for note in told)  # words, not Python


def test_random_motion_stays_in_the_calibration_box() -> None:
    robot = ideal_robot(START)
    motion = random_motion(robot, 60.0, rng=np.random.default_rng(3))
    q = motion.sample(np.arange(0.0, 60.0, 0.01))[0]
    assert (q >= CALIBRATION_LOWER).all()
    assert (q <= CALIBRATION_UPPER).all()


def test_random_motion_of_any_robot_stays_within_its_limits() -> None:
    model = load_robot("panda")
    robot = ideal_robot(0.5 * (model.lower + model.upper), "panda")
    check_motion(model, random_motion(robot, 30.0, rng=np.random.default_rng(0)))


def test_motions_go_on_to_their_end() -> None:
    robot = ideal_robot(START)
    summary = operator_motion.run_random(robot, 4.0, rng=np.random.default_rng(0))
    assert summary.duration >= 4.0
    assert (summary.ended_by, summary.state.state) == (None, "PAUSED")
    robot.plant.state_command("resume")
    summary = follow_motion(robot, file_of([[0.5], [0.7]], [0.0, 2.0]))
    assert_allclose(summary.q[0], 0.7)
    assert summary.state.state == "PAUSED"


@pytest.mark.parametrize(
    ("q", "time", "complaint"),
    [
        ([[0.5], [9.0]], [0.0, 60.0], "outside"),
        ([[0.5], [0.7]], [0.0, 0.1], "velocity"),
        ([[1.57], [1.5]], [0.0, 20.0], "from the start"),
    ],
)
def test_a_file_that_cannot_be_followed_moves_nothing(q: object, time: object, complaint: str) -> None:
    robot = ideal_robot(START)
    with pytest.raises(LimitError, match=complaint):
        follow_motion(robot, file_of(q, time))
    assert robot.plant.setpoints == []
    assert robot.plant.operating_state().state == "ENABLED"  # a refusal changes nothing


def test_a_far_start_is_gone_to_when_asked() -> None:
    robot = ideal_robot(START)
    near_the_ends = robot.model.upper[1] - 0.01, robot.model.lower[1] + 0.01
    far = max(near_the_ends, key=lambda q: abs(q - START[1]))
    summary = follow_motion(robot, file_of([[far]], [0.0], names=("elbow",)), from_afar=True)
    assert_allclose(summary.q[1], far)


def test_units_that_contradict_the_robot_are_refused() -> None:
    with pytest.raises(InputError, match="in rad, not m"):
        follow_motion(ideal_robot(START), file_of([[0.4], [0.41]], [0.0, 2.0], units=("m",)))


def read(folder: Path, text: str, **options: float) -> MotionLog:
    (folder / "run.csv").write_text(text)
    return read_followed_file(folder / "run.csv", **options)


def test_units_of_the_heading_are_obeyed(tmp_path: Path) -> None:
    file = read(tmp_path, "time [ms],elbow [deg],insertion [mm]\n500,90,400\n1500,180,350\n")
    assert (file.joint_names, file.joint_units) == (("elbow", "insertion"), ("rad", "m"))
    assert_allclose(file.time, [0.0, 1.0])
    assert_allclose(file.q_nominal, [[np.pi / 2, 0.4], [np.pi, 0.35]])


def test_a_published_zigzag_becomes_the_trajectory_of_the_generator(tmp_path: Path) -> None:
    rows = zigzag_rows("J1", 0.5)
    np.savetxt(tmp_path / "traj.csv", rows, delimiter=",", fmt="%.17g")
    file = read_followed_file(tmp_path / "traj.csv")
    times = np.linspace(0.0, file.time[-1], 501)
    # each row is a corner here, only the turns are there: straight between either way
    q, expected = (motion.sample(times)[0] for motion in (along_rows(file), zigzag("J1", [0.5])))
    assert_allclose(q, expected, rtol=0.0, atol=1e-9)
    assert file.notes


def test_a_motion_log_is_followed_along_what_the_robot_reported(tmp_path: Path) -> None:
    q = np.column_stack([np.linspace(0.1, 0.2, 20), np.linspace(0.3, 0.25, 20)])
    log = MotionLog("run", ("a", "b"), ("rad", "m"), q, np.ones(20, bool), time=5.0 + 0.1 * np.arange(20))
    write_parquet(log, tmp_path / "run.parquet")
    file = read_followed_file(tmp_path / "run.parquet")
    assert file.time[0] == 0.0
    assert_allclose(file.q_nominal, q)
    assert pq.read_schema(tmp_path / "run.parquet").names  # the file is left as it was


def test_an_archive_states_its_units(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q=[[90.0], [45.0]], t=[0.0, 2.0], units=["deg"], joint_names=["a"])
    assert_allclose(read_followed_file(tmp_path / "run.npz").q_nominal, [[np.pi / 2], [np.pi / 4]])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("time [s],elbow\n0,1\n", "no unit"),
        ("time [s],elbow [grad]\n0,1\n", "grad"),
        ("elbow [deg],time [s]\n0,1\n", "first column"),
        ("time [s],elbow [deg]\n0,1\n1,x\n", "line 3"),
        ("1,2\n3,4\n", "heading"),
        ("", "got no line"),
        *((f"time [s],elbow [deg]\n{rows}", "row 2: time does not rise") for rows in ("0,1\n0,2\n", "1,1\n0,2\n")),
        ("time [s],elbow [deg]\n0,1\n1,nan\n", "q_nominal is nan at row 1"),
    ],
)
def test_a_csv_that_leaves_a_doubt_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises((FileFormatError, InputError), match=complaint):
        read(tmp_path, text)


def test_a_rate_is_refused_where_the_file_has_times(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="states its times"):
        read(tmp_path, "time [s],elbow [deg]\n0,1\n1,2\n", rows_per_second=10.0)
