"""Stamps of two topics that lie unlike times before arrival are named, with what the motion says of them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.plant import MotionLog
from catenary.recording.journal import JournalTopic, JournalWriter
from catenary.recording.logs import read_log, write_parquet
from catenary.recording.messages import ros2_name, typestore
from catenary.verdict.check import findings_of
from catenary.verdict.finding import Finding
from catenary.workflows.import_recording import import_recording
from lab_bags import JOINT_STATE, JOINTS, KINDS, START, Message, joint_state, write_bag
from tests.verdict.test_delay import cable_arm

ROBOT, CAMERA = "/arm/measured_js", "/camera/joints"
MAP = [f"q_nominal={ROBOT}.position", f"q_encoder={CAMERA}.position"]
WAY = {ROBOT: 2_000_000, CAMERA: 2_000_000}  # [ns]
Write = Callable[[Path, list[Message], dict[str, int]], Path]


def messages(clock: float = 0.0) -> list[Message]:
    """A robot at 30 Hz, and a camera at as much whose clock is that much behind [s]."""
    log = cable_arm(seconds=60.0)
    told: list[Message] = [(t, ROBOT, joint_state(JOINTS, q)) for t, q in zip(log.time, log.q_nominal, strict=True)]
    return told + [(t - clock, CAMERA, joint_state(JOINTS, q)) for t, q in zip(log.time, log.q_encoder, strict=True)]


def of_kind(kind: str) -> Write:
    topics = {ROBOT: JOINT_STATE, CAMERA: JOINT_STATE}
    return lambda folder, told, way: write_bag(folder / "lab", kind, topics, told, late=way)  # type: ignore[arg-type]


def of_journal(folder: Path, told: list[Message], way: dict[str, int]) -> Path:
    store = typestore(1)
    with JournalWriter(folder / "lab", [JournalTopic(topic, "sensor_msgs/JointState") for topic in way]) as journal:
        for time, topic, make in sorted(told, key=lambda message: message[0]):
            at = START + round(time * 1e9)
            head = store.types["std_msgs/msg/Header"](
                seq=0, stamp=store.types["builtin_interfaces/msg/Time"](*divmod(at, 10**9)), frame_id=""
            )
            data = store.serialize_ros1(make(store, head), ros2_name("sensor_msgs/JointState"))
            journal.append(topic, at + way[topic], bytes(data))
    return folder / "lab"


def named(log: MotionLog, name: str = "clock") -> list[Finding]:
    return [each for each in findings_of(log) if each.name == name and not each.refuses]


@pytest.mark.alike
@pytest.mark.parametrize("write", [*map(of_kind, KINDS), of_journal], ids=[*KINDS, "journal"])
def test_a_longer_way_is_named_over_every_container(tmp_path: Path, write: Write) -> None:
    path = write(tmp_path, messages(), WAY | {CAMERA: 72_000_000})
    log = import_recording(path, MAP, units="rad,rad,m")
    (found,) = named(log)
    assert "stamped 0.072 s before their arrival, commands 0.002 s" in found.says
    assert "a slower path to the recorder" in found.culprit
    write_parquet(log, tmp_path / "lab.parquet")
    assert named(read_log(tmp_path / "lab.parquet")) == [found]


def test_a_clock_that_is_behind_is_told_by_the_motion(tmp_path: Path) -> None:
    path = of_kind("mcap")(tmp_path, messages(0.2), WAY | {CAMERA: 202_000_000})
    (found,) = named(import_recording(path, MAP, units="rad,rad,m"))
    assert found.culprit == "two clocks that differ by that: the motion shows it"


@pytest.mark.parametrize("way", [2_000_000, 30_000_000, 0], ids=["the same", "below a period", "stamp is arrival"])
def test_what_says_nothing_is_not_named(tmp_path: Path, way: int) -> None:
    path = of_kind("mcap")(tmp_path, messages(), WAY | {CAMERA: way})
    assert named(import_recording(path, MAP, units="rad,rad,m")) == []


@pytest.mark.alike
@pytest.mark.parametrize(("lag", "delay"), [(0.06, 0.0), (0.06, 0.1), (0.0, 0.1)])
def test_a_controllers_lag_is_told_apart_where_the_report_was_recorded_too(lag: float, delay: float) -> None:
    log = cable_arm()
    setpoint = np.column_stack([np.interp(log.time + lag, log.time, column) for column in log.q_nominal.T])
    seen = np.column_stack([np.interp(log.time - delay, log.time, column) for column in log.q_encoder.T])
    both = replace(log, q_nominal=setpoint, q_reported=log.q_nominal, q_encoder=seen)
    (said,) = named(both, "lag")
    assert f"lag their setpoints by {lag:+.3f} s" in said.says.replace("-0.000", "+0.000")
    (found,) = (each for each in findings_of(both) if each.name == "delay")
    assert found.refuses == bool(delay)
    assert found.delay is not None
    assert_allclose(found.delay.seconds, delay, atol=0.01)
    # the setpoint alone cannot tell
    alone = next(each for each in findings_of(replace(both, q_reported=None)) if each.name == "delay")
    assert alone.delay is not None
    assert_allclose(alone.delay.seconds, lag + delay, atol=0.01)


def test_setpoint_report_and_measurement_come_out_of_a_bag_and_stay_in_the_log(tmp_path: Path) -> None:
    log = cable_arm(seconds=20.0)
    told: list[Message] = []
    for t, q, seen in zip(log.time, log.q_nominal, log.q_encoder, strict=True):
        told += [(t, "/arm/setpoint_js", joint_state(JOINTS, q)), (t, ROBOT, joint_state(JOINTS, q - 0.01))]
        told.append((t, CAMERA, joint_state(JOINTS, np.rad2deg(seen))))
    path = write_bag(tmp_path / "lab", "ros1", dict.fromkeys(("/arm/setpoint_js", ROBOT, CAMERA), JOINT_STATE), told)
    mapped = [
        "q_nominal=/arm/setpoint_js.position",
        f"q_reported={ROBOT}.position",
        f"q_encoder={CAMERA}.position@deg,deg,m",
    ]
    read = import_recording(path, mapped, units="rad,rad,m")
    write_parquet(read, tmp_path / "lab.parquet")
    for one in (read, read_log(tmp_path / "lab.parquet")):
        assert one.q_reported is not None
        assert_allclose(one.q_reported, log.q_nominal - 0.01, atol=1e-9)


def test_commands_that_leap_between_poses_are_a_staircase_and_no_stamps_in_minutes() -> None:
    log, rng = cable_arm(seconds=60.0), np.random.default_rng(0)
    assert log.q_encoder is not None
    rows = np.repeat(rng.choice(len(log), 20, replace=False), 500)
    measured = log.q_encoder[rows] + 1e-5 * rng.standard_normal((len(rows), log.q_encoder.shape[1]))
    ok, time = np.ones(10_000, dtype=bool), 0.001 * np.arange(10_000.0)
    poses = MotionLog("poses", log.joint_names, log.joint_units, log.q_nominal[rows], ok, measured, time)
    found = findings_of(poses)
    assert not any(each.refuses for each in found)
    assert [each.says for each in found if each.name == "short"] == [
        "commands leap between 20 poses and rest there: all rows of a pose hold the same information"
    ]
