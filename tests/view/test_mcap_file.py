"""A recording as MCAP and URDF, read by other libraries: schemas, stamps, and poses that are forward kinematics."""

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from mcap.reader import make_reader
from numpy.testing import assert_allclose
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

import own_base
from catenary.calibration import calibration
from catenary.errors import FileFormatError
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from catenary.robots.shapes import load_geometry
from catenary.view.mcap_file import McapSummary, write_mcap
from catenary.view.replay import recorded_arm
from command_line import catenary, refusal

ROWS = 400
TILT = np.deg2rad(30.0)
SCHEMAS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/measured/joint_states": "sensor_msgs/msg/JointState",
    "/gravity_torque": "sensor_msgs/msg/JointState",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/gravity": "geometry_msgs/msg/Vector3Stamped",
    "/robot_description": "std_msgs/msg/String",
}


def recording(robot: str = "raven2", **changed: object) -> MotionLog:
    """Joints that swing within their limits, 200 rows a second, on a base that is tilted about x."""
    model = load_robot(robot)
    time = 100.0 + 0.005 * np.arange(ROWS)
    low, high = (np.clip(limit, -2.0, 2.0) for limit in (model.lower, model.upper))
    share = 0.5 + 0.4 * np.sin(time[:, None] * np.arange(1, model.n + 1))
    q = low + share * (high - low)
    ok = np.ones(ROWS, dtype=bool)
    ok[100:150] = False
    gravity = {"gravity:x": 0.0, "gravity:y": -9.81 * np.sin(TILT), "gravity:z": -9.81 * np.cos(TILT)}
    whole: dict[str, object] = {
        "name": "swing", "joint_names": model.joint_names, "joint_units": model.joint_units, "q_nominal": q, "ok": ok,
        "q_encoder": q + 0.01, "time": time, "qd": np.gradient(q, time, axis=0), "tau": 0.1 * q, "robot": robot,
        "signals": {name: np.full(ROWS, value) for name, value in gravity.items()},
    }  # fmt: skip
    return MotionLog(**{**whole, **changed})  # type: ignore[arg-type]


def written(log: MotionLog, folder: Path) -> McapSummary:
    model = load_robot(str(log.robot))
    geometry = load_geometry(str(log.robot), model)
    return write_mcap(recorded_arm(log, model), log, folder / "swing.mcap", () if geometry is None else geometry.shapes)


def messages(path: Path) -> list[tuple[str, str, int, object]]:
    """Topic, schema, stamp [ns] and message, as the mcap library finds them and rosbags reads them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    with path.open("rb") as file:
        return [
            (channel.topic, schema.name, message.log_time, store.deserialize_cdr(message.data, schema.name))
            for schema, channel, message in make_reader(file).iter_messages(log_time_order=False)
        ]


@pytest.fixture(scope="module")
def swing(tmp_path_factory: pytest.TempPathFactory) -> tuple[MotionLog, McapSummary]:
    log = recording()
    return log, written(log, tmp_path_factory.mktemp("mcap"))


def test_topics_have_the_standard_schemas_and_ascending_stamps(swing: tuple[MotionLog, McapSummary]) -> None:
    log, made = swing
    found = messages(made.file)
    assert {topic: schema for topic, schema, _, _ in found} == SCHEMAS
    stamps = [stamp for _, _, stamp, _ in found]
    assert stamps == sorted(stamps)
    assert stamps[0] == 100_000_000_000
    for topic, count in made.messages.items():
        assert sum(name == topic for name, *_ in found) == count
    for _, _, stamp, message in found:
        if hasattr(message, "header"):
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
    with made.file.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics.message_count == len(found)
    profiles = {c.topic: YAML(typ="safe").load(c.metadata["offered_qos_profiles"]) for c in summary.channels.values()}
    # rmw.h: 1 is transient local, 1 is reliable
    latched = {
        t for t, found in profiles.items() if found and (found[0]["durability"], found[0]["reliability"]) == (1, 1)
    }
    assert latched == {"/robot_description", "/tf_static"}
    assert log.time is not None


def test_joint_states_are_the_recordings_rows(swing: tuple[MotionLog, McapSummary]) -> None:
    log, made = swing
    states = [message for topic, _, _, message in messages(made.file) if topic == "/joint_states"]
    assert states[0].name == list(log.joint_names)
    assert_allclose([s.position for s in states], log.q_nominal)
    assert_allclose([s.velocity for s in states], log.qd)
    assert_allclose([s.effort for s in states], log.tau)
    measured = [message for topic, _, _, message in messages(made.file) if topic == "/measured/joint_states"]
    assert_allclose([s.position for s in measured], log.q_encoder[log.ok])


@pytest.mark.parametrize("robot", ["raven2", "raven2_full_right", "ur5e"])
def test_poses_are_those_of_the_urdf_beside_it(robot: str, tmp_path: Path) -> None:
    log = recording(robot)
    made = written(log, tmp_path)
    assert made.urdf is not None
    assert made.urdf.read_text() == next(
        m.data for topic, *_, m in messages(made.file) if topic == "/robot_description"
    )
    base = load_robot(robot).base
    peer = pinocchio.buildModelFromUrdf(str(made.urdf))
    data = peer.createData()
    found = messages(made.file)
    static = {t.child_frame_id: t for topic, *_, m in found if topic == "/tf_static" for t in m.transforms}
    checked = 0
    for topic, _, stamp, message in found:
        children = {t.child_frame_id: t for t in message.transforms} if topic == "/tf" else {}
        if load_robot(robot).link_names[0] not in children:
            continue
        row = int(np.argmin(np.abs(np.rint(log.time * 1e9) - stamp)))
        q = pinocchio.neutral(peer)
        for name, value in zip(log.joint_names, log.q_nominal[row], strict=True):
            if peer.existJointName(name):
                place = peer.joints[peer.getJointId(name)].idx_q
                q[place] = value
        pinocchio.framesForwardKinematics(peer, data, q)
        for name in [*children, *(child for child in static if "/" not in child and child != base)]:
            theirs = data.oMf[peer.getFrameId(name, pinocchio.FrameType.BODY)]
            rotation, position = in_base(name, {**static, **children}, base)
            assert_allclose(position, theirs.translation, atol=1e-9)
            assert_allclose(rotation, theirs.rotation, atol=1e-9)
        checked += 1
        if checked == 20:
            break
    assert checked == 20


def in_base(name: str, transforms: dict, base: str) -> tuple[np.ndarray, np.ndarray]:
    """Follow transforms from a frame to the base."""
    rotation, position = np.eye(3), np.zeros(3)
    while name != base:
        t = transforms[name]
        turned = Rotation.from_quat([getattr(t.transform.rotation, axis) for axis in "xyzw"]).as_matrix()
        moved = np.array([getattr(t.transform.translation, axis) for axis in "xyz"])
        rotation, position = turned @ rotation, turned @ position + moved
        name = t.header.frame_id
    return rotation, position


def test_base_stands_in_the_world_as_gravity_says(swing: tuple[MotionLog, McapSummary]) -> None:
    found = messages(swing[1].file)
    vector = next(m.vector for topic, *_, m in found if topic == "/gravity")
    gravity = np.array([vector.x, vector.y, vector.z])
    assert_allclose(gravity, [0.0, -9.81 * np.sin(TILT), -9.81 * np.cos(TILT)])
    base = next(t for topic, *_, m in found if topic == "/tf" for t in m.transforms if t.child_frame_id == "base")
    assert base.header.frame_id == "world"
    turned = Rotation.from_quat([getattr(base.transform.rotation, axis) for axis in "xyzw"])
    assert_allclose(turned.apply(gravity), [0.0, 0.0, -9.81], atol=1e-9)


def test_urdf_shows_the_links(swing: tuple[MotionLog, McapSummary]) -> None:
    visual = pinocchio.buildGeomFromUrdfString
    model = pinocchio.buildModelFromUrdf(str(swing[1].urdf))
    shapes = visual(model, swing[1].urdf.read_text(), pinocchio.GeometryType.VISUAL)
    assert len(shapes.geometryObjects) >= 3


def test_recording_without_gravity_or_truth_says_so(tmp_path: Path) -> None:
    made = written(recording(signals={}, q_encoder=None, tau=None, qd=None), tmp_path)
    assert any("level" in note for note in made.notes)
    assert not {"/measured/joint_states", "/gravity_torque"} & set(made.messages)


def test_a_full_disk_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    older = tmp_path / "swing.mcap"
    older.write_bytes(b"older")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(FileFormatError, match="cannot be written: No space left"):
        written(recording(), tmp_path)
    assert older.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [older]


def test_calibrated_arm_is_where_the_model_says(tmp_path: Path) -> None:
    log, path, out = recording(), tmp_path / "swing.parquet", tmp_path / "swing.mcap"
    write_parquet(log, path)
    calibration.fit(log, model="offset", accept=["short"]).save(tmp_path / "offset.npz")
    outcome = catenary("export", path, "--mcap", out, "--model", tmp_path / "offset.npz")
    assert outcome.code == 0
    found = messages(out)
    states = [m for topic, _, _, m in found if topic == "/calibrated/joint_states"]
    # the encoders read 0.01 more than the robot says, everywhere
    assert_allclose([s.position for s in states], log.q_nominal + 0.01, atol=1e-9)
    frames = {t.child_frame_id for topic, *_, m in found if topic == "/tf" for t in m.transforms}
    assert {name for name in frames if name.startswith("calibrated/")} != set()


def test_command_writes_both_files_and_refuses_what_does_not_fit(tmp_path: Path) -> None:
    log, out = tmp_path / "swing.parquet", tmp_path / "swing.mcap"
    write_parquet(recording(), log)
    outcome = catenary("export", log, "--mcap", out)
    assert outcome.code == 0
    assert (tmp_path / "swing.urdf").is_file()
    assert "/joint_states (400)" in outcome.out
    assert catenary("export", log, "--mcap", out).code == 0  # an older one is replaced
    assert "give one of --c, --onnx and --mcap" in refusal("export", log)
    assert "--robot: goes with --mcap" in refusal("export", "raven2", "--c", tmp_path / "a.h", "--robot", "raven2")
    (tmp_path / "swing.urdf").write_text("notes")
    assert "something else" in refusal("export", log, "--mcap", out)


def test_every_frame_has_one_parent_and_the_robots_own_names_stay_its_own(tmp_path: Path) -> None:
    (tmp_path / "turned.urdf").write_text(own_base.URDF)
    made = written(recording(str(tmp_path / "turned.urdf")), tmp_path)
    parents: dict[str, set[str]] = {}
    places: dict[str, Any] = {}
    for topic, *_, message in messages(made.file):
        for one in message.transforms if topic in ("/tf", "/tf_static") else ():
            parents.setdefault(one.child_frame_id, set()).add(one.header.frame_id)
            places[one.child_frame_id] = one.transform.translation
    assert parents["base_link"] == {"level_world"}
    assert parents["base"] == parents["world"] == {"base_link"}
    assert all(len(above) == 1 for above in parents.values())
    assert (places["base"].x, places["world"].z) == (0.1, -0.5)
    assert {m.header.frame_id for topic, *_, m in messages(made.file) if topic == "/gravity"} == {"base_link"}
