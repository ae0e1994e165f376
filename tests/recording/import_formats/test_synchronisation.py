"""Two computers that log one motion: how far their clocks are apart, and how fast they run apart, against the truth."""

import re
from pathlib import Path

import numpy as np
import pytest

from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording.import_formats.sampled_signals import Series, TopicReport
from catenary.recording.import_formats.synchronisation import clock_by_motion
from catenary.recording.logs import read_log
from catenary.topics import SECOND
from catenary.workflows.import_recording import import_recording
from command_line import catenary, refusal
from lab_bags import JOINT_STATE, joint_state, write_bag
from tests.drawn_arms.arm import Arm

CAMERA_HZ = 30.0
REPORT = TopicReport("", 0, CAMERA_HZ, (), 0, 0, 0.0, stamped_by_arrival=False)
NAMES = ["--map", "q_nominal=robot:J*@rad", "--map", "q_encoder=camera:J*@rad"]


def recorded(seed: int, motion: str, seconds: float) -> MotionLog:
    return Arm(seed).moved(motion, 5, seconds).log


def seen(log: MotionLog, ahead: float, ppm: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a camera with a clock of its own saw: its stamps, and joints at 30 Hz."""
    at = np.arange(0.3, log.time[-1] - 0.5, 1.0 / CAMERA_HZ)
    return at * (1.0 + 1e-6 * ppm) + ahead, np.column_stack([np.interp(at, log.time, c) for c in log.q_encoder.T])


def series(stamps: np.ndarray, values: np.ndarray) -> Series:
    return Series(np.rint(np.asarray(stamps) * SECOND).astype(np.int64), values, REPORT)


@pytest.mark.parametrize(
    ("seed", "motion", "ahead", "ppm"),
    [
        (1, "random", 0.014, 0.0),
        (3, "task", -0.0023, 0.0),
        (5, "zigzag", 0.73, 50.0),
        (3, "task", 7200.0, 50.0),
        (5, "zigzag", -30.0, 300.0),
    ],
)
def test_a_clock_is_found_to_3_ms_and_3_ppm(seed: int, motion: str, ahead: float, ppm: float) -> None:
    log = recorded(seed, motion, 300.0)
    found = clock_by_motion(series(log.time, log.q_nominal), series(*seen(log, ahead, ppm)), log.joint_units, "camera")
    assert found.is_certain or abs(ahead) < 0.02
    assert abs(found.ahead - ahead) < 0.003
    assert abs(found.fast - 1e-6 * ppm) < 3e-6
    low, high = found.interval
    assert low < ahead < high


def test_other_motion_and_motion_that_only_repeats_itself_are_refused() -> None:
    log, other = recorded(1, "random", 120.0), Arm(1).moved("random", 6, 120.0).log
    with pytest.raises(InputError, match=r"camera: no motion in common .* --clock SECONDS,PPM"):
        clock_by_motion(series(log.time, log.q_nominal), series(*seen(other, 5.0, 0.0)), log.joint_units, "camera")
    t = np.arange(0.0, 120.0, 0.02)
    wave = np.column_stack([np.sin(2.0 * np.pi * t / 4.0), np.cos(2.0 * np.pi * t / 2.0)])
    part = slice(1000, 5000)
    with pytest.raises(InputError, match="the motion repeats itself: its clock may be"):
        clock_by_motion(series(t, wave), series(t[part] - 7.0, wave[part]), ("rad", "rad"), "camera")


def written(folder: Path, log: MotionLog, ahead: float, ppm: float) -> list[Path]:
    """Write a robot's table, and a camera's."""
    paths = [folder / "robot.csv", folder / "camera.csv"]
    tables = [(log.time, log.q_nominal), seen(log, ahead, ppm)]
    for path, (stamps, values) in zip(paths, tables, strict=True):
        head = ",".join(["t", *log.joint_names])
        np.savetxt(path, np.column_stack([stamps, values]), delimiter=",", header=head, comments="", fmt="%.9f")
    return paths


@pytest.fixture(scope="module")
def robot() -> MotionLog:
    """An arm without slides, so that units are rad."""
    seed = next(s for s in range(1, 100, 2) if set(Arm(s).units) == {"rad"})
    return recorded(seed, "random", 240.0)


def off(log: MotionLog, robot: MotionLog) -> float:
    """Return the largest time by which measurements are out of step [s], as a joint's speed shows it."""
    first = int(np.searchsorted(robot.time, log.began - 1e-6))
    rows = slice(first, first + len(log))
    speed, error = np.gradient(robot.q_encoder, robot.time, axis=0)[rows], log.q_encoder - robot.q_encoder[rows]
    ok = log.ok
    return max(abs(float(e[ok] @ v[ok]) / float(v[ok] @ v[ok])) for e, v in zip(error.T, speed.T, strict=True))


def test_files_of_two_computers_become_one_recording(robot: MotionLog, tmp_path: Path) -> None:
    paths, out = written(tmp_path, robot, 7200.0, 50.0), tmp_path / "both.parquet"
    done = catenary("import", *paths, *NAMES, "--out", out)
    assert done.code == 0, done
    log = read_log(out)
    assert log.ok.mean() > 0.99
    assert off(log, robot) < 0.003
    assert any("its clock is +7200.0" in note and "ppm" in note for note in log.notes)
    assert "--clock" not in " ".join(each for each in done.err.splitlines() if "refuse" in each)


def test_a_table_an_hdf5_file_and_a_bag_have_a_clock_each(robot: MotionLog, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    robot_csv, _ = written(tmp_path, robot, 0.0, 0.0)
    stamps, values = seen(robot, 7200.0, 50.0)
    with h5py.File(tmp_path / "camera.h5", "w") as file:
        file["t"], file["joints"] = stamps, values
    rows = [np.ascontiguousarray(row) for row in robot.q_nominal]
    told = [(t + 0.25, "/js", joint_state(list(robot.joint_names), q)) for t, q in zip(robot.time, rows, strict=True)]
    bag = write_bag(tmp_path / "arm", "ros1", {"/js": JOINT_STATE}, told)
    mapping = ["q_nominal=robot:J*", "q_encoder=camera:joints", "q_reported=/js.position"]
    log = import_recording([robot_csv, tmp_path / "camera.h5", bag], mapping, units="rad")
    assert off(log, robot) < 0.003
    assert sum("its clock is" in note for note in log.notes) == 2
    assert not any("before arrival" in note for note in log.notes)
    rest = log.q_nominal - log.q_reported
    assert np.abs(rest[10:-10]).max() < 0.02


def test_tables_with_the_same_names_are_told_apart_by_their_files(robot: MotionLog, tmp_path: Path) -> None:
    paths, out = written(tmp_path, robot, 12.0, 0.0), tmp_path / "both.parquet"
    assert catenary("import", *paths, "--units", "rad", "--yes", "--out", out).code == 0
    assert off(read_log(out), robot) < 0.003
    other = paths[1].rename(tmp_path / "second.csv")  # whose name says nothing
    asked = refusal("import", paths[0], other, "--units", "rad", "--yes", "--out", tmp_path / "asked.parquet")
    assert "--answer q_nominal=robot:J1" in asked
    answered = ("--answer", "q_nominal=robot:J1", "--out", tmp_path / "answered.parquet")
    assert catenary("import", paths[0], other, "--units", "rad", *answered).code == 0
    assert off(read_log(tmp_path / "answered.parquet"), robot) < 0.003


def test_a_clock_that_is_given_is_taken_and_stamps_stay_as_they_are_if_it_is_none(
    robot: MotionLog, tmp_path: Path
) -> None:
    paths = written(tmp_path, robot, 0.5, 0.0)
    mapping = NAMES[1::2]
    assert off(import_recording(paths, mapping, clock=["0.4,0"]), robot) == pytest.approx(0.1, abs=0.02)
    assert off(import_recording(paths, mapping, clock=["camera=0.5"]), robot) < 0.003
    assert off(import_recording(paths, mapping, clock=["0,0"]), robot) > 0.3
    assert off(import_recording(paths, mapping), robot) < 0.003
    assert "no file cam: expected camera" in refusal(
        "import", *paths, *NAMES, "--clock", "cam=1", "--out", tmp_path / "x.parquet"
    )
    alone = ("--map", "q_nominal=J*@rad", "--clock", "1", "--out", tmp_path / "x.parquet")
    assert "none is read beside q_nominal's" in refusal("import", paths[0], *alone)
    assert "expected seconds and ppm" in refusal(
        "import", *paths, *NAMES, "--clock", "soon", "--out", tmp_path / "x.parquet"
    )


@pytest.mark.parametrize("later", [-90.0, 1.25, 0.3])  # back to zero, and set anew: s ahead after half of the file
def test_parts_after_a_restart_have_a_clock_each(robot: MotionLog, tmp_path: Path, later: float) -> None:
    paths = written(tmp_path, robot, 0.014, 0.0)
    head, *lines = paths[1].read_text().splitlines()
    cells = [line.split(",") for line in lines]
    half = len(cells) // 2
    again = [[f"{float(t) + later:.9f}", *rest] for t, *rest in cells[half + 30 :]]
    paths[1].write_text("\n".join([head, *(",".join(row) for row in [*cells[:half], *again])]))
    log = import_recording(paths, NAMES[1::2])
    assert log.ok.mean() > 0.95
    assert max(off(log.part(0, len(log) // 3), robot), off(log, robot)) < 0.003
    clocks = [
        re.search(r"from row (\d+) on: its clock is (\S+) s", note) for note in log.notes if "its clock is" in note
    ]
    assert [int(clock[1]) for clock in clocks if clock] == [0, half]
    assert [float(clock[2]) for clock in clocks if clock] == pytest.approx([0.014, 0.014 + later], abs=0.003)


def test_rows_without_time_stay_without(robot: MotionLog, tmp_path: Path) -> None:
    paths = written(tmp_path, robot, 50.0, 0.0)
    lines = paths[1].read_text().splitlines()
    lines[200:300] = [f"nan,{line.partition(',')[2]}" for line in lines[200:300]]
    paths[1].write_text("\n".join(lines))
    log = import_recording(paths, NAMES[1::2])
    assert any("100 rows without time were left out" in note for note in log.notes)
    assert off(log, robot) < 0.003


def test_files_whose_clocks_cannot_be_told_say_what_would(robot: MotionLog, tmp_path: Path) -> None:
    (path, camera), out = written(tmp_path, robot, 1e5, 0.0), tmp_path / "both.parquet"
    t = np.arange(0.0, 200.0, 0.1)
    table = np.column_stack([t + 1e5, np.sin(np.outer(t, np.arange(1.0, 1.0 + len(robot.joint_names))))])
    np.savetxt(camera, table, delimiter=",", header=",".join(["t", *robot.joint_names]), comments="")
    assert "--clock SECONDS,PPM" in refusal("import", path, camera, *NAMES, "--out", out)
    assert not out.exists()
