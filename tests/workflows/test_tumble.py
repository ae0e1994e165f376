"""A gravity sensor's calibration: by a tumble, and from recordings in which it rested."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.imu_recording import ImuRecording, read_imu
from catenary.robots.catalog import load_robot
from catenary.sensing.mounting import Mounting, load_mounting
from catenary.sensing.tumble import fit_orientations
from catenary.simulation.sensors import SensorModel
from catenary.workflows.sense import (
    ATTITUDES,
    Attitude,
    StillReading,
    calibrate_replay,
    read_still,
    replay_feed,
    rests,
    run_tumble,
    simulated_reader,
    up_of_tilts,
)
from command_line import catenary, refusal
from lab_bags import Message, write_bag

TRUE = Mounting(
    rotation=Rotation.from_euler("xyz", [0.4, -0.8, 2.0]).as_matrix(),
    bias=np.array([0.3, -0.2, 0.4]),
    scale=np.array([1.02, 0.98, 1.01]),
    rate_bias=np.array([0.02, -0.01, 0.03]),
)
READER = simulated_reader(SensorModel(mounting=TRUE), seed=1)


@cache
def readings() -> dict[str, StillReading]:
    """Of the sensor at rest, by attitude."""
    return {attitude.name: READER(attitude) for attitude in ATTITUDES}


def test_a_tumble_finds_bias_scale_and_rotation_of_a_sensor():
    start = Mounting(position=np.array([0.1, 0.2, 0.3]))
    outcome = run_tumble(lambda attitude: readings()[attitude.name], start=start)
    assert outcome.faults == ()
    # noise of 0.04 m/s2 over 200 samples
    assert_allclose(outcome.mounting.bias, TRUE.bias, atol=0.01)
    assert_allclose(outcome.mounting.scale, TRUE.scale, atol=0.001)
    assert_allclose(outcome.mounting.rate_bias, TRUE.rate_bias, atol=1e-3)
    turned = Rotation.from_matrix(outcome.mounting.rotation @ TRUE.rotation.T).magnitude()
    assert np.degrees(turned) < 0.2  # heading from tilts of 20 degrees is three times less sure than up
    assert_allclose(outcome.mounting.position, [0.1, 0.2, 0.3])


def spoilt(change):
    """A reader of a sensor whose driver changes what it reads."""
    return lambda attitude: StillReading(change(readings()[attitude.name].force), None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda y: -y, "on its sides: wrong sign"),
        (lambda y: y[[1, 0, 2]], "on its sides: wrong axes: x reads +y, y reads +x, z reads +z"),
        (lambda y: y / 9.80665, "seem to be in g"),
    ],
)
def test_a_driver_that_is_wrong_is_named(change, said):
    outcome = run_tumble(spoilt(change))
    assert any(said in fault for fault in outcome.faults), outcome.faults


def test_a_base_that_was_tilted_the_other_way_is_told():
    def read(attitude):
        other = attitude._replace(up=tuple(np.array(attitude.up) * [-1, 1, 1]))
        return READER(other) if attitude.name == "pitched" else readings()[attitude.name]

    outcome = run_tumble(read)
    assert any("was it tilted as asked" in fault for fault in outcome.faults), outcome.faults


R = Rotation.from_euler("XYZ", [0.3, -0.2, 1.0]).as_matrix()  # R_base_imu
BIAS, RATE_BIAS = np.array([0.2, -0.1, 0.3]), np.array([0.01, -0.02, 0.005])
TILTS = [(0.0, 0.0), (20.0, 0.0), (-20.0, 0.0), (0.0, 20.0), (0.0, -20.0), (15.0, 15.0)]
HZ = 50


def recorded(up: Floats, *, noise: float = 0.01) -> ImuRecording:
    """Two seconds in each orientation, a second of shaking between."""
    rng = np.random.default_rng(4)
    force, rate = [], []
    for direction in up:
        still = 9.81 * R.T @ direction + BIAS + noise * rng.normal(size=(2 * HZ, 3))
        force += [still, still[0] + 3.0 * rng.normal(size=(HZ, 3))]
        rate += [RATE_BIAS + 0.001 * rng.normal(size=(2 * HZ, 3)), rng.normal(size=(HZ, 3))]
    rows = np.concatenate(force)
    return ImuRecording(np.arange(len(rows)) / HZ, rows, np.concatenate(rate))


def written(path: Path, r: ImuRecording, names: str = "time,ax,ay,az,gx,gy,gz") -> Path:
    rate = np.zeros_like(r.force) if r.rate is None else r.rate
    np.savetxt(path, np.column_stack([r.time, r.force, rate]), delimiter=",", header=names, comments="")
    return path


def test_rests_of_a_recording_are_found_and_motion_between_them_is_not() -> None:
    found = rests(recorded(up_of_tilts(TILTS)))
    assert len(found) == len(TILTS)
    assert_allclose([f.force for f in found], 9.81 * up_of_tilts(TILTS) @ R + BIAS, atol=0.01)


def test_mounting_and_biases_come_out_of_a_whole_robots_orientations() -> None:
    outcome = calibrate_replay(recorded(up_of_tilts(TILTS)), up_of_tilts(TILTS))
    assert outcome.faults == ()
    assert_allclose(outcome.mounting.rotation, R, atol=2e-3)  # noise 0.01 m/s2 of 9.81, over 50 readings each
    assert_allclose(outcome.mounting.bias, BIAS, atol=0.02)
    assert_allclose(outcome.mounting.rate_bias, RATE_BIAS, atol=1e-3)


TEN = [*TILTS, (-15.0, -15.0), (60.0, 0.0), (0.0, 70.0), (-80.0, 30.0)]


def turned_between(turns: list[Rotation], *, hz: int = 100) -> ImuRecording:
    """Two seconds in each orientation and 1.5 s of a smooth turn into the next, with what a gyroscope reads there."""
    rng = np.random.default_rng(6)
    force, rate = [], []
    for k, turn in enumerate(turns):
        still = np.tile(9.81 * turn.inv().apply([0.0, 0.0, 1.0]), (2 * hz, 1))
        force.append(still)
        rate.append(np.zeros_like(still))
        if k + 1 < len(turns):
            s = (np.arange(1, int(1.5 * hz) + 1) / (1.5 * hz))[:, None]
            share, speed = s**3 * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s**2 * (1.0 - s) ** 2 / 1.5
            by = (turn.inv() * turns[k + 1]).as_rotvec()
            force.append(9.81 * (turn * Rotation.from_rotvec(share * by)).inv().apply([0.0, 0.0, 1.0]))
            rate.append(speed * by)
    up, omega = np.concatenate(force), np.concatenate(rate)
    y = up @ R + BIAS + 0.02 * rng.normal(size=up.shape)
    w = omega @ R + RATE_BIAS + 0.001 * rng.normal(size=up.shape)
    return ImuRecording(np.arange(len(y)) / hz, y, w)


SWAP = np.eye(3)[[1, 0, 2]]


@pytest.mark.parametrize(
    ("force", "rate", "said"),
    [
        (np.eye(3), np.eye(3), ""),
        (np.eye(3), -np.eye(3), "its x, y, z seem to be -x,-y,-z"),
        (np.eye(3), np.diag([1.0, -1.0, -1.0]), "its x, y, z seem to be x,-y,-z"),  # half of NED
        (np.diag([1.0, -1.0, -1.0]), np.eye(3), "its x, y, z seem to be x,-y,-z"),
        (np.eye(3), 2.5 * np.eye(3), "times as far as the gyroscope reads"),
        (np.eye(3) / 9.80665, np.eye(3), "seem to be in g, expected m/s2"),
        (-np.eye(3), np.eye(3), "left-handed"),
        (SWAP, SWAP, "left-handed"),
    ],
)
def test_what_a_recording_gets_wrong_is_named_and_not_written(force: Floats, rate: Floats, said: str) -> None:
    right = turned_between([Rotation.from_euler("XY", tilt, degrees=True) for tilt in TEN])
    outcome = calibrate_replay(ImuRecording(right.time, right.force @ force.T, right.rate @ rate.T), up_of_tilts(TEN))
    assert any(said in fault for fault in outcome.faults) if said else outcome.faults == (), outcome.faults
    if not said:
        assert_allclose(outcome.mounting.rate_bias, RATE_BIAS, atol=2e-4)  # the starts of turns do not count
        assert_allclose(outcome.mounting.rotation, R, atol=2e-3)


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        (np.eye(3), ""),
        (-np.eye(3), "its x, y, z seem to be -x,-y,-z"),
        (SWAP, "its x, y, z seem to be y,x"),
        (np.degrees(np.eye(3)), "it seems to be in deg/s"),
        (2.5 * np.eye(3), "times as far as the gyroscope reads"),
        (0.15, "ms late"),
    ],
)
def test_the_turns_of_a_tumble_by_hand_check_the_gyroscope(rate: Floats | float, said: str) -> None:
    # where up is in base axes, as a person holds the sensor and then tilts the base
    ups = [np.array(a.up) if a.mounted else R @ a.up for a in ATTITUDES]
    right = turned_between([Rotation.align_vectors([0.0, 0.0, 1.0], up)[0] for up in ups])
    late = round(100 * rate) if isinstance(rate, float) else 0
    rates = np.roll(right.rate, late, axis=0) if isinstance(rate, float) else right.rate @ rate.T
    feed = replay_feed(ImuRecording(right.time, right.force, rates))

    def read(attitude: Attitude) -> StillReading:
        feed.wait(3.5 * ATTITUDES.index(attitude) + 0.2 - feed.now())  # a person presses Enter
        return read_still(feed)

    outcome = run_tumble(read, taken=feed.taken)
    assert any(said in fault for fault in outcome.faults) if said else outcome.faults == (), outcome.faults
    assert outcome.mounting.checked is (said == "")


def test_an_arm_that_carries_the_sensor_turns_it() -> None:
    arm, rng = load_robot("raven2"), np.random.default_rng(0)
    q = arm.lower + (arm.upper - arm.lower) * rng.uniform(size=(5, 3))
    up = forward_kinematics(arm, q).rotation[:, 2, :]
    for pose, direction in zip(q, up, strict=True):
        assert_allclose(forward_kinematics(arm, pose).rotation @ direction, [0.0, 0.0, 1.0], atol=1e-12)
    assert_allclose(calibrate_replay(recorded(up), up).mounting.rotation, R, atol=5e-3)


def test_scale_is_fitted_where_there_are_orientations_enough(rng: np.random.Generator) -> None:
    up = rng.normal(size=(12, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    scale = np.array([1.02, 0.97, 1.0])
    fit = fit_orientations(scale * (9.81 * up @ R) + BIAS, up)
    assert_allclose(fit.scale, scale, atol=1e-8)
    assert_allclose(fit.rotation, R, atol=1e-8)
    assert_allclose(fit.bias, BIAS, atol=1e-7)


def test_orientations_in_another_order_are_a_fault_and_too_few_are_refused() -> None:
    up = up_of_tilts(TILTS)
    assert "right, in order" in calibrate_replay(recorded(up), up[[1, 0, 2, 3, 4, 5]]).faults[0]
    with pytest.raises(InputError, match="the recording has 6 rests"):
        calibrate_replay(recorded(up), up[:5])
    with pytest.raises(InputError, match="at least 4"):
        fit_orientations(up[:3], up[:3])
    with pytest.raises(InputError, match="tilt about two axes"):
        fit_orientations(9.81 * up[[0, 1, 0, 1]], up[[0, 1, 0, 1]])


def test_a_csv_is_replayed_and_calibrated_by_the_command(tmp_path: Path) -> None:
    imu = written(tmp_path / "imu.csv", recorded(up_of_tilts(TILTS)))
    turned, out = tmp_path / "turned.csv", tmp_path / "m.toml"
    np.savetxt(turned, TILTS, delimiter=",", header="roll_deg,pitch_deg", comments="")
    done = catenary("sense", "--replay", imu, "--tumble", "--orientations", turned, "--out", out, "--json").json
    assert done["faults"] == []
    assert_allclose(load_mounting(out).rotation, R, atol=2e-3)
    level = written(tmp_path / "level.csv", recorded(up_of_tilts(TILTS[:1])), "t_s,fx,fy,fz,wx,wy,wz")
    shown = catenary("sense", "--replay", level, "--mounting", out, "--duration", "1.5", "--json").json
    assert set(shown["readings"]) == {"live"}
    assert_allclose(shown["mean"], [0.0, 0.0, -9.81], atol=0.03)


def test_a_deck_that_was_recorded_is_live_and_doubted_where_no_ship_was_told_of(tmp_path: Path) -> None:
    rng, t = np.random.default_rng(1), np.arange(0.0, 8.0, 0.02)
    force = np.array([0.0, 0.0, 9.81]) + np.outer(2.5 * np.sin(0.24 * np.pi * t), [0.0, 0.0, 1.0])
    deck = ImuRecording(t, force + 0.02 * rng.normal(size=force.shape), 0.001 * rng.normal(size=force.shape))
    line = ("sense", "--replay", written(tmp_path / "deck.csv", deck), "--json", "--mounting-on")
    assert catenary(*line, "ship").json["faults"] == {}
    told = catenary(*line, "table").json
    assert told["faults"]["magnitude"] > 100
    assert set(told["readings"]) == {"live"}


def imu_bag(path: Path, absent: str = "") -> Path:
    """A bag of 20 readings, of which the covariance says that one quantity is not measured."""

    def message(k: int) -> Message:
        def make(store: Any, head: Any) -> Any:
            vector, turn = (store.types["geometry_msgs/msg/Vector3"], store.types["geometry_msgs/msg/Quaternion"])
            nine, none = np.zeros(9), np.r_[-1.0, np.zeros(8)]
            force, rate = (none if name == absent else nine for name in ("linear_acceleration", "angular_velocity"))
            turning, pulled = vector(0.1, 0.0, 0.01 * k), vector(0.5, float(k), 9.8)
            return store.types["sensor_msgs/msg/Imu"](
                head, turn(0.0, 0.0, 0.0, 1.0), nine, turning, rate, pulled, force
            )

        return 0.02 * k, "/imu", make

    return write_bag(path / "imu", "sqlite", {"/imu": "sensor_msgs/msg/Imu"}, [message(k) for k in range(20)])


def test_an_imu_of_a_bag_is_read_by_its_stamps_and_what_it_does_not_measure_left_out(tmp_path: Path) -> None:
    found = read_imu(imu_bag(tmp_path))
    assert_allclose(found.time, 0.02 * np.arange(20), atol=1e-9)
    assert_allclose(found.force[:, 1], np.arange(20))
    assert_allclose(found.rate[:, 2], 0.01 * np.arange(20))
    (tmp_path / "no rates").mkdir()
    found = read_imu(imu_bag(tmp_path / "no rates", "angular_velocity"))
    assert found.rate is None
    assert any("measure no angular velocity" in note for note in found.notes)
    (tmp_path / "no force").mkdir()
    with pytest.raises(FileFormatError, match=r"20 messages say .covariance -1. that they measure no acceleration"):
        read_imu(imu_bag(tmp_path / "no force", "linear_acceleration"))


def test_recordings_and_options_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    imu = written(tmp_path / "imu.csv", recorded(up_of_tilts(TILTS[:1])))
    odd = written(tmp_path / "odd.csv", recorded(up_of_tilts(TILTS[:1])), "time,q1,q2,q3,q4,q5,q6")
    with pytest.raises(InputError, match=r"no columns of an accelerometer such as ax, ay, az: .*; it has time, q1"):
        read_imu(odd)
    assert read_imu(odd, columns=("q1", "q2", "q3")).rate is None
    with pytest.raises(InputError, match="expected three"):
        read_imu(odd, columns=("q1", "q2"))
    with pytest.raises(FileFormatError, match="no such file"):
        read_imu(tmp_path / "none.csv")
    with pytest.raises(InputError, match="expected topic /imu"):
        read_imu(imu, topic="/imu")
    assert "give one of" in refusal("sense", "--replay", imu, "--simulated")
    assert "--columns: goes with --replay" in refusal("sense", "--simulated", "--columns", "a,b,c")
    assert "give both --tumble and --orientations" in refusal("sense", "--replay", imu, "--tumble")
    assert "--robot: goes with --orientations" in refusal("sense", "--replay", imu, "--robot", "raven2")
    assert "no column roll_deg" in refusal("sense", "--replay", imu, "--tumble", "--orientations", imu)
