"""Joints from the poses of a tracked marker: the nearest that the robot reaches; trackers' files beyond the gallery.

Where a robot says that its tip is, against its file: the distance is named, and what makes it.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.bounded_parsers import toml_table
from catenary.dynamics.inverse_kinematics import nearest_coordinates
from catenary.dynamics.kinematics import Configuration, forward_kinematics, jacobian
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.recording.import_formats import recording_files
from catenary.recording.import_formats.mapping import TrackedPose
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.registration import TrackedPoses
from catenary.recording.import_formats.tracked_pose import deviations, joints_from_poses, pose_places
from catenary.robots.catalog import load_robot
from catenary.spatial import Pose, quaternion_from_rotation, rotation_from_rpy
from catenary.workflows import import_recording as in_pieces
from catenary.workflows.import_recording import import_recording, import_to_file
from gallery.trackers import ROWS, P, R, motive, table, transforms, write
from lab_bags import JOINT_STATE, KINDS, POSE, Kind, Message, joint_state, pose, write_bag

TRACKER = Pose(rotation_from_rpy([0.1, -0.2, 1.0]), np.array([0.4, -0.3, 0.9]))  # in the base
MARKER = Pose(rotation_from_rpy([0.0, 0.3, 0.0]), np.array([0.01, 0.0, -0.02]))  # the tip in the marker's frame


def tracked(path: Path, robot: str, reported: Floats, truth: Floats, off: Floats | float = 0.0) -> Path:
    """A CSV of reported joints in rad and m, and the marker's pose in mm and as x, y, z, w, off by some mm."""
    model, rows = load_robot(robot), []
    for q, real, wrong in zip(reported, truth, np.broadcast_to(off, (len(truth), 3)), strict=True):
        marker = TRACKER.inverse() @ forward_kinematics(model, real) @ MARKER.inverse()
        w, x, y, z = quaternion_from_rotation(marker.rotation)
        rows.append([*q, *(1e3 * marker.position + wrong), x, y, z, w])
    names = [*(f"q{j}" for j in range(model.n)), "x", "y", "z", "qx", "qy", "qz", "qw"]
    table = np.column_stack([0.02 * np.arange(len(rows)), rows])
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *names]), comments="")
    return path


def mapping(robot: str, **how: object) -> dict[str, object]:
    transforms = {
        name: {
            "position_m": pose.position.tolist(),
            "quaternion_wxyz": quaternion_from_rotation(pose.rotation).tolist(),
        }
        for name, pose in (("T_base_tracker", TRACKER), ("T_marker_frame", MARKER))
    }
    pose = {"columns": ["x", "y", "z", "qx", "qy", "qz", "qw"], "unit": "mm", **transforms, **how}
    return {
        "robot": robot,
        "time": "t",
        "q_nominal": {"columns": [f"q{j}" for j in range(load_robot(robot).n)]},
        "q_encoder": {"pose": pose},
    }


def motion(robot: str, rows: int = 60) -> Floats:
    """A smooth motion in the middle half of the limits."""
    model, s = load_robot(robot), np.linspace(0.0, 1.0, rows)[:, None]
    phase, rate = np.arange(model.n), 1.0 + np.arange(model.n) % 3
    low, high = np.maximum(model.lower, -1.5), np.minimum(model.upper, 1.5)
    return np.asarray(0.5 * (low + high) + 0.25 * (high - low) * np.sin(2.0 * np.pi * rate * s + phase))


@pytest.mark.slow  # compiles the robot's kinematics
def test_six_joints_follow_from_a_pose(tmp_path: Path) -> None:
    q = motion("raven2_full", rows=12)
    error = np.array([0.02, -0.015, 0.002, 0.1, -0.08, 0.05])
    path = tracked(tmp_path / "arm.csv", "raven2_full", q, q + error)
    log = import_recording(path, mapping("raven2_full", match="pose"))
    model = load_robot("raven2_full")
    near_singular = [np.linalg.svd(jacobian(model, each), compute_uv=False)[-1] < 0.01 for each in q + error]
    assert_array_equal(log.ok, np.logical_not(near_singular))
    assert_allclose(
        log.q_encoder[log.ok], (q + error)[log.ok], atol=1e-5
    )  # the CSV has all digits; the search ends within 1e-9 m


@pytest.mark.parametrize(
    ("robot", "match", "lost", "choice"),
    [
        ("dvrk_psm", "position", "outer_yaw, .*, outer_wrist_yaw", 'match = "pose" or'),
        ("dvrk_psm_motors", "pose", "q4, q5, q6, q7", "a frame that they move"),  # its file ends at the insertion
        ("planar_3r", "position", "link1, link2, link3", 'match = "pose" or'),
        ("panda", "pose", "q1, q2, q3, q4, q5, q6, q7", "a frame that they move"),  # one joint too many
    ],
)
def test_a_pose_that_leaves_joints_open_is_refused(
    tmp_path: Path, robot: str, match: str, lost: str, choice: str
) -> None:
    q = motion(robot, rows=12)
    path = tracked(tmp_path / "arm.csv", robot, q, q + 0.01)
    said = f"the {match} of .* leaves {lost} open, of {q.shape[1]} joints: .* expected {choice}"
    with pytest.raises(InputError, match=said):
        import_recording(path, mapping(robot, match=match))


def test_a_pose_turned_about_the_tools_own_axis_leaves_its_roll_open_and_no_other() -> None:
    model = load_robot("raven2_full")
    q = motion("raven2_full", 3)[1]
    roll = model.joint_names.index("roll")
    axis = jacobian(model, q)[3:, roll]
    assert np.linalg.norm(axis) == pytest.approx(1.0)
    for chosen in ([0, 1, 2], [roll]):
        assert np.isfinite(deviations(model, q[None], None, "pose")[0, chosen]).all()
    arm = load_robot("raven2")  # the first three joints, whose tip is on the tool's axis
    assert np.isfinite(deviations(arm, motion("raven2", 3), None, "position")).all()


def test_singular_poses_in_passing_are_rows_without_a_measurement(tmp_path: Path) -> None:
    q = motion("two_link")
    q[30, 1] = 0.0  # stretched: the tip does not tell which way the elbow bends
    log = import_recording(tracked(tmp_path / "arm.csv", "two_link", q, q), mapping("two_link"))
    assert not log.ok[30]
    assert log.ok[np.abs(q[:, 1]) > 0.1].all()
    assert (~log.ok).sum() < 5
    assert any("singular" in note for note in log.notes)


def seen_by_a_tracker(robot: str, match: str, through: dict[int, tuple[float, float]], noise: Floats) -> Any:
    """Where joints are by a tracker of known noise, where they truly are, and the notes; some joints move `through`."""
    model, rng, rows = load_robot(robot), np.random.default_rng(0), 500
    q, s = motion(robot, rows), np.linspace(0.0, 1.0, rows)
    for j, (middle, reach) in through.items():
        q[:, j] = middle + reach * np.sin(8.0 * s + 0.3)
    poses = forward_kinematics(model, q)
    position = poses.position + noise[0] * rng.normal(size=(rows, 3))
    rotation = Rotation.from_rotvec(noise[1] * rng.normal(size=(rows, 3))).as_matrix() @ poses.rotation
    tracked = TrackedPose(
        columns=["x", "y", "z", "a", "b", "c", "d"], unit="m", match=match, within_mm=20, within_deg=20
    )
    here = Pose(np.eye(3), np.zeros(3))
    reported = q + 5e-3 * np.sin(9.0 * s)[:, None] * np.where(np.array(model.joint_units) == "rad", 1.0, 0.1)
    marker = TrackedPoses(position, rotation, reported, np.zeros_like(q))
    return model, q, *joints_from_poses(model, tracked, marker, here, here, list(range(model.n)))


NOISES = ((2e-4, 3e-3), (1.4e-3, 9e-3))  # [m], [rad] of an optical tracker, and an electromagnetic one
NEAR_SINGULAR = (
    ("ur5e", "pose", {1: (-0.8, 0.2), 2: (1.2, 0.2), 4: (0.0, 0.8)}),
    ("dvrk_psm", "pose", {2: (0.03, 0.015)}),
    ("raven2", "position", {1: (1.5, 0.4), 2: (0.42, 0.12)}),
    ("two_link", "position", {1: (0.0, 1.0)}),
    ("planar_3r", "pose", {1: (0.0, 1.0)}),
)
NAMED = (  # joints that are lost, and where
    ("wrist_1_joint|wrist_3_joint", "wrist_2_joint -?0.[0-9]+ deg"),
    ("outer_yaw|outer_pitch", "outer_insertion [0-9.]+ mm"),
    ("shoulder|elbow", "insertion 4[67][0-9.]+ mm"),
    ("link0|link1", "link1 -?[01].[0-9]+ deg"),
    ("link1|link2", "link2 -?[01].[0-9]+ deg"),
)
SCENES = [pytest.param(*scene, *named, id=scene[0]) for scene, named in zip(NEAR_SINGULAR, NAMED, strict=True)]
# compiles the robot's kinematics
SCENES += [pytest.param("raven2_full", "pose", dict[int, Any](), "", "", id="raven2_full", marks=pytest.mark.slow)]


@pytest.mark.parametrize("noise", NOISES, ids=["optical", "electromagnetic"])
@pytest.mark.parametrize(("robot", "match", "through", "lost", "at"), SCENES)
def test_rows_near_a_singular_pose_are_no_truth_and_others_hold_what_they_claim(
    robot: str, match: str, through: dict[int, tuple[float, float]], lost: str, at: str, noise: tuple[float, float]
) -> None:
    model, q, found, notes = seen_by_a_tracker(robot, match, through, np.array(noise))
    ok = np.isfinite(found).all(axis=1)
    claimed = deviations(model, found[ok], None, match, np.array(noise))
    off = np.abs(found - q)[ok] / claimed
    assert off.max() < 5.0  # of 3000 normal numbers the largest is at 3.6
    assert 0.8 < np.sqrt(np.mean(off**2)) < 1.2
    true = deviations(model, q, None, match, np.array(noise))
    far = (true < 0.01).all(axis=1)  # 0.6 deg or 10 mm: far from the singularity
    assert ok[far].sum() >= 0.99 * far.sum()
    assert ok.mean() > 0.3
    told = " ".join(notes)
    most = np.array([np.rad2deg(1.0) if unit == "rad" else 1e3 for unit in model.joint_units]) * claimed.max(axis=0)
    stated = [float(re.search(rf"standard deviation .*\b{name} ([0-9.]+) ", told)[1]) for name in model.joint_names]
    assert_allclose(stated, most, rtol=0.15)  # how well 500 rows tell the noise
    if lost:
        assert not ok.all()
        assert re.search(f"poses lie too near a singularity, the nearest with {at}", told), told
        assert re.search(f"more than .*({lost}) ", told), told


@pytest.mark.slow  # as above
def test_an_arm_that_reaches_no_measured_pose_is_taken_at_its_nearest(tmp_path: Path) -> None:
    q = motion("planar_3r")
    noise = np.random.default_rng(0).normal(0.0, 0.2, (len(q), 3))  # [mm], out of the arm's plane too
    path = tracked(tmp_path / "arm.csv", "planar_3r", q, q + 0.01, noise)
    log = import_recording(path, mapping("planar_3r", match="pose"))
    assert log.ok.mean() > 0.85  # not ok are those within some degrees of the stretched arm
    # 0.2 mm at 0.2 m and more is 1 mrad, and three joints share it
    assert np.sqrt(np.mean((log.q_encoder - q - 0.01)[log.ok] ** 2)) < 4e-3
    few = import_recording(path, mapping("planar_3r", match="pose", within_mm=0.2))
    assert 0 < few.ok.sum() < 0.9 * len(q)
    assert any("beyond 0.2 mm and 1 deg from all that the robot reaches" in note for note in few.notes)
    with pytest.raises(InputError, match="q_encoder is measured on none"):
        import_recording(tracked(tmp_path / "far.csv", "planar_3r", q, q, 50.0), mapping("planar_3r", match="pose"))


@pytest.mark.slow  # as above
def test_nothing_beside_the_nearest_coordinates_is_nearer() -> None:
    model, rng = load_robot("planar_3r"), np.random.default_rng(1)
    for q in motion("planar_3r", 8):
        reached = forward_kinematics(model, q)
        wanted = Pose(
            reached.rotation @ rotation_from_rpy([0.02, 0.01, 0.0]), reached.position + np.array([0.0, 3e-3, 1e-3])
        )
        found = nearest_coordinates(model, wanted, q)
        square = found.position_error**2 + found.orientation_error**2
        for step in rng.normal(0.0, 1e-3, (20, model.n)):
            beside = nearest_coordinates(model, wanted, found.q + step, max_iterations=0)
            assert square <= beside.position_error**2 + beside.orientation_error**2 + 1e-12


def posed(path: Path, robot: str, reported: Floats, truth: Floats, **how: object) -> tuple[Path, dict[str, object]]:
    """A CSV as `tracked` writes it, of a tracker of 0.2 mm, and a mapping that gives no transform."""
    noise = np.random.default_rng(2).normal(0.0, 0.2, (len(truth), 3))
    given = mapping(robot, **how)
    del given["q_encoder"]["pose"]["T_base_tracker"], given["q_encoder"]["pose"]["T_marker_frame"]
    return tracked(path, robot, reported, truth, noise), given


@pytest.mark.parametrize("columns", [["x", "y", "z", "qx", "qy", "qz", "qw"], ["x", "y", "z"]])
def test_without_transforms_the_joints_follow_but_for_zeros_that_nothing_tells(
    columns: list[str], tmp_path: Path
) -> None:
    q = motion("raven2", 400)
    q[:, 2] = 0.3 + 0.5 * (q[:, 2] - q[:, 2].mean())  # the tool's point stays 0.1 m from the remote centre
    error = (
        np.array([0.02, -0.015, 0.002]) + np.array([0.01, 0.01, 0.001]) * np.sin(np.linspace(0.0, 40.0, 400))[:, None]
    )
    path, given = posed(tmp_path / "arm.csv", "raven2", q, q + error, columns=columns)
    log = import_recording(path, given)
    assert log.ok.mean() > 0.99
    off = log.q_encoder - q - error
    free = off - off.mean(axis=0)
    assert_allclose(free[log.ok], 0.0, atol=8e-3)  # 0.2 mm at 0.1 m is 2 mrad
    constant = off[log.ok].mean(axis=0)
    notes = " ".join(log.notes)
    stated = re.search(r"may put q_encoder off by, 95 %: .*?elbow ([\d.]+) deg", notes)
    assert abs(constant[1]) < np.deg2rad(float(stated[1])) < 0.1  # the zero of the elbow is told
    assert "no motion tells the zero of shoulder, insertion" in notes
    assert constant[0] == pytest.approx(-0.02, abs=2e-3)  # and is what the note says: as reported
    toml = next(note for note in log.notes if note.startswith("T_base_tracker = ")).partition("#")[0]
    base = toml_table(toml, "note")["T_base_tracker"]
    marker = toml_table(next(n for n in log.notes if n.startswith("T_marker_frame = ")).partition("#")[0], "note")
    pose = {**given["q_encoder"]["pose"], "T_base_tracker": base, **marker}
    again = import_recording(path, {**given, "q_encoder": {"pose": pose}})
    assert_allclose(again.q_encoder[log.ok], log.q_encoder[log.ok], atol=1e-4)  # the note's digits
    assert not any("registered" in note for note in again.notes)


RPY = ["x", "y", "z", "roll", "pitch", "yaw"]


@pytest.mark.parametrize("kind", KINDS)
def test_transforms_are_followed_by_child_each_with_its_own_stamp(kind: Kind, tmp_path: Path) -> None:
    source = transforms(tmp_path / "lab", kind)
    sources = Sources([source])
    reference = "/tf.transforms[probe/1].transform"
    places = pose_places(TrackedPose(columns=(reference,)), sources.streams)
    stream = sources.read({"/tf": [place.column for place in places]})["/tf"]
    there = [i for i in range(ROWS) if i % 5 > 0 or i % 3 > 0]
    assert_allclose(np.column_stack([stream.columns[p.column] for p in places[:3]]), P[there], atol=1e-12)
    late = (stream.arrival - stream.stamp) / 1e9 - 0.002  # a message takes 2 ms to arrive
    assert_allclose(late, 0.2, atol=1e-6)
    assert (np.diff(stream.arrival) > 0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda d: motive(d / "take.csv", "1.23", "Furlongs"), "Length Units of meters, centimeters, millimeters, got fur"),
        (lambda d: write(d / "take.csv", ["Format Version,1.2,Length Units,Meters", "", "1,2,3"]), "lines of types, names"),
    ],
)  # fmt: skip
def test_an_export_that_is_not_as_its_program_writes_it_is_refused(
    make: Callable[[Path], Path], message: str, tmp_path: Path
) -> None:
    with pytest.raises(FileFormatError, match=message):
        Sources([make(tmp_path)])


@pytest.mark.parametrize(
    ("pose", "error", "message"),
    [
        ({"columns": RPY}, InputError, "6 columns with orientation"),
        ({"columns": ["x", "y"]}, InputError, "expected a message's pose, or three, six or seven"),
        ({"columns": RPY, "orientation": "XXZ"}, ConfigError, "turns twice about one axis"),
        ({"columns": RPY, "orientation": "rpy"}, ConfigError, "orientation"),
    ],
)
def test_a_pose_that_cannot_be_one_is_refused(
    pose: dict[str, Any], error: type[Exception], message: str, tmp_path: Path
) -> None:
    source = table(tmp_path / "rpy.csv", "t,x,y,z,roll,pitch,yaw", R.as_euler("xyz"), clock=0.0)
    whole = {"robot": "two_link", "q_nominal": {"columns": ["x", "y"]}, "q_encoder": {"pose": pose}}
    with pytest.raises(error, match=message):
        import_recording(source, whole)


PSM = load_robot("dvrk_psm")
ASIDE = Pose(rotation_from_rpy([0.0, 0.0, 0.3]), np.array([0.2, 0.1, 0.0]))
OFF = np.array([0.1, -0.2, 0.0, 0.3, 0.0, 0.0])
LONGER = Pose(np.eye(3), np.array([0.0, 0.0, 0.0508]))  # an S or Si instrument's


def lab(path: Path, tip: Callable[[np.ndarray], Pose], **others: Callable[[np.ndarray], Pose]) -> Path:
    """A PSM that reports its joints at 100 Hz and its tip at 40 Hz."""
    messages: list[Message] = []

    def q(t: float) -> np.ndarray:
        return np.array([0.5, 0.4, 0.03, 0.6, 0.5, 0.4]) * np.sin(t * np.linspace(1.0, 1.5, 6)) + [0, 0, 0.12, 0, 0, 0]

    for t in np.arange(0.0, 6.0, 0.01):
        messages.append((t, "/PSM1/measured_js", joint_state(PSM.joint_names, q(t))))
    for t in np.arange(0.0, 6.0, 0.025):
        for verb, of in {"measured_cp": tip, **{f"{k}/measured_cp": v for k, v in others.items()}}.items():
            at = of(q(t))
            messages.append((t, f"/PSM1/{verb}", pose(at.position, quaternion_from_rotation(at.rotation))))
    return write_bag(
        path, "ros1", {topic: JOINT_STATE if "js" in topic else POSE for _, topic, _ in messages}, messages
    )


def true(q: np.ndarray) -> Pose:
    return forward_kinematics(PSM, q)


SAID = {
    "as its file": (true, {}, ""),
    "another base frame, and its own beside": (lambda q: ASIDE @ true(q), {"local": true}, ""),
    "another tool": (lambda q: true(q) @ LONGER, {}, r"50\.8 mm and 0\.0 deg .* another tool"),
    "another base": (lambda q: ASIDE @ true(q), {}, r" mm and 17\.2 deg .* another base frame"),
    "joints of another zero": (lambda q: true(q + OFF), {}, "another robot, or other units"),
}


@pytest.mark.slow  # compiles the robot's kinematics
def test_a_tip_that_is_elsewhere_is_named_with_its_distance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mapping = {"robot": "dvrk_psm", "q_nominal": {"columns": "/PSM1/measured_js.position"}}
    for name, (tip, others, words) in SAID.items():
        bag = lab(tmp_path / name.replace(" ", "_"), tip, **others)
        log = import_recording(bag, mapping)
        told = [note for note in log.notes if "from the tip of" in note]
        assert len(told) == bool(words), (name, log.notes)
        assert not words or re.search(words, told[0]), told
    monkeypatch.setattr(in_pieces, "_PIECE_NUMBERS", 13 * 100)
    monkeypatch.setattr(in_pieces, "_OVERLAP_ROWS", 20)
    monkeypatch.setattr(recording_files, "_BATCH_MESSAGES", 50)
    done = import_to_file(tmp_path / "log.parquet", [tmp_path / "another_tool.bag"], mapping)
    assert len([note for note in done.notes if "from the tip of" in note]) == 1


@pytest.mark.parametrize("ahead", [-0.4, 7200.2])
def test_a_tracker_on_another_clock_is_brought_onto_the_robots_by_the_motion(ahead: float, tmp_path: Path) -> None:
    t, rng, model = np.arange(600) / 20.0, np.random.default_rng(1), load_robot("raven2")
    middle, reach = np.array([0.6, 1.4, 0.35]), np.array([0.4, 0.4, 0.05])
    rates = np.array([[0.31, 0.73, 1.0], [0.43, 0.61, 1.3], [0.37, 0.83, 1.1]])

    def driven(at: Floats) -> Floats:
        sines = np.sin(at[:, None, None] * 1.5 * rates + np.arange(9).reshape(3, 3))
        return np.asarray(middle + reach * sines.mean(axis=2))

    seen_at = 3.0 + np.arange(480) / 20.0
    frame = Configuration(model, driven(seen_at) + 0.01).pose()
    seen = (TRACKER.inverse() @ frame @ MARKER.inverse()).position + 1e-4 * rng.normal(size=(480, 3))
    for name, head, rows in (
        ("robot", "t,q0,q1,q2", np.column_stack([t, driven(t)])),
        ("camera", "t,x,y,z", np.column_stack([seen_at + ahead, 1e3 * seen])),
    ):
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header=head, comments="")
    columns = mapping("raven2", columns=["x", "y", "z"], match="position")
    log = import_recording([tmp_path / "robot.csv", tmp_path / "camera.csv"], columns)
    assert log.ok.mean() > 0.5
    assert_allclose((log.q_encoder - log.q_nominal)[log.ok].mean(axis=0), 0.01, atol=1e-3)
    found = next(note for note in log.notes if "s ahead of q_nominal's" in note)
    assert float(found.split("clock is ")[1].split(" s")[0]) == pytest.approx(ahead, abs=0.1)
