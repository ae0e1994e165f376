"""Poses as trackers and their programs write them: each file small and made here, its poses known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.recording.import_formats.mapping import TrackedPose
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.tracked_pose import pose_places, positions_and_rotations
from catenary.workflows.import_recording import import_recording, propose_mapping
from lab_bags import JOINT_STATE, KINDS, POSE, Kind, Message, joint_state, pose, write_bag

ROWS = 40
T = 0.05 * np.arange(ROWS)
P = np.column_stack([0.1 * np.sin(T), 0.2 * np.cos(2.0 * T), 1.0 + 0.1 * T])  # [m]
R = Rotation.from_euler("ZYX", np.column_stack([0.5 * np.sin(T), 0.3 * np.cos(T), 1.0 + 0.2 * T]))
Q = R.as_quat()  # x, y, z, w
LOST = np.arange(10, 14)  # rows on which the tracker saw nothing
Made = tuple[Path, dict[str, Any], str]  # file, what a mapping says of the pose, what the proposal says
UNIT = {"Meters": 1.0, "Furlongs": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}


def write(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


def motive(path: Path, version: str, unit: str, *, turns: str = "Quaternion") -> Path:
    """Motive's export of a body, one of its markers and one that has no name, as its versions write it."""
    labelled = version == "1.25"
    words = ("Type", "Name", "ID", "Parent") if labelled else ("", "", "", "")
    body, marker, stray = ["Rigid Body"] * 8, ["Rigid Body Marker"] * 3, ["Marker"] * 3
    names = ["tool"] * 8 + ["tool:Marker1"] * 3 + ["Unlabeled 12"] * 3
    rows = [
        ["", words[0], *body, *marker, *stray],
        ["", words[1], *names],
        ["", words[2], *['"1:2"'] * 14],
        *[["", words[3], *[""] * 14]] * labelled,
        ["", "", *["Rotation"] * 4, *["Position"] * 3, "Mean Marker Error", *["Position"] * 6],
        ["Frame", "Time (Seconds)", *"XYZW", *"XYZ", "", *"XYZ", *"XYZ"],
    ]
    settings = f"Format Version,{version},Take Name,a,Capture Frame Rate,20.0,Rotation Type,{turns},Length Units,{unit}"
    lines = [settings, "", *(",".join(map(str, row)) for row in rows)]
    for i in range(ROWS):
        numbers = [*Q[i], *UNIT[unit] * P[i], 0.0002, *UNIT[unit] * (P[i] + 0.01)]
        cells = [""] * 14 if i in LOST else [*(f"{number:.9f}" for number in numbers), "", "", ""]
        lines.append(",".join([str(i), f"{T[i]:.6f}", *cells]))
    return write(path, lines)


def ndi(path: Path, *, timed: bool) -> Path:
    """NDI's export of two tools, the first of which has one marker."""
    time = ["Time [sec]"] if timed else []
    tool = ["Frame", *time, "Face", "State", "Q0", "Qx", "Qy", "Qz", "Tx", "Ty", "Tz", "Error"]
    first = ["Port 0x01: probe  s/n:3E4C880C", *tool, "Markers", "State", "Tx", "Ty", "Tz"]
    lines = [",".join(["Tools", *first, "Port 2", *tool])]
    for i in range(ROWS):
        x, y, z, w = Q[i]
        clock = [f"{1.7e9 + T[i]:.6f}"] if timed else []
        head = [str(1000 + 3 * i), *clock, "1"]
        full = ["OK", *(f"{v:.9f}" for v in (w, x, y, z, *1e3 * P[i])), "0.2"]
        # a tool that is not seen has empty cells, or a number beyond all
        full = ["MISSING", *["0"] * 4, *["-3.697314e+28"] * 3, ""] if i in LOST else full
        lines.append(
            ",".join(["2", first[0], *head, *full, "1", "OK", "0", "0", "0", "Port 2", *head, "MISSING", *[""] * 8])
        )
    return write(path, lines)


def table(
    path: Path, names: str, turns: Floats, scale: float = 1.0, separator: str = ",", clock: float = 1.7e9
) -> Path:
    """A table of time, position and orientation; rows that were not seen are empty."""
    rows = [[clock + T[i], *scale * P[i], *turns[i]] for i in range(ROWS)]
    lines = [separator.join(f"{v:.9f}" for v in row) for row in rows]
    for i in LOST:
        lines[i] = separator.join([f"{rows[i][0]:.9f}", *["nan"] * (len(rows[i]) - 1)])
    return write(path, ([names] if names else []) + lines)


def bag(path: Path, kind: Kind) -> Path:
    """An Atracsys behind CRTK's topics beside a PSM, whose own pose and goal are no measurement."""
    messages: list[Message] = []
    for i, t in enumerate(T):
        seen = np.where(i in LOST, 0.0, P[i])
        x, y, z, w = Q[i]
        for topic in (
            "/atracsys/probe/measured_cp",
            "/PSM1/measured_cp",
            "/PSM1/setpoint_cp",
            "/arm/local/measured_cp",
        ):
            messages.append((t, topic, pose(seen, (w, x, y, z))))
        for arm in ("/PSM1", "/arm"):
            messages.append((t, f"{arm}/measured_js", joint_state(("a", "b"), (np.sin(t), np.cos(t)))))
    made: Path = write_bag(path, kind, {one[1]: JOINT_STATE if "js" in one[1] else POSE for one in messages}, messages)
    return made


def transforms(path: Path, kind: Kind) -> Path:
    """/tf with stamps of its own for each child: the marker's comes 0.2 s before the message, with or without others."""

    def make(i: int) -> Callable[[Any, Any], Any]:
        def message(store: Any, head: Any) -> Any:
            types, made = store.types, []
            for child, late in (("base", 0.0), ("probe/1", 0.2))[:: -1 if i % 3 else 1][: 1 + (i % 5 > 0 or i % 3 > 0)]:
                stamp = head.stamp.sec * 10**9 + head.stamp.nanosec - round(late * 1e9)
                time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
                own = types["std_msgs/msg/Header"](stamp=time, frame_id="tracker")
                at = P[i] if child != "base" else np.ones(3)
                vector = types["geometry_msgs/msg/Vector3"](*map(float, at))
                turn = types["geometry_msgs/msg/Quaternion"](*map(float, Q[i] if child != "base" else (0, 0, 0, 1)))
                transform = types["geometry_msgs/msg/Transform"](vector, turn)
                made.append(types["geometry_msgs/msg/TransformStamped"](own, child, transform))
            return types["tf2_msgs/msg/TFMessage"](made)

        return message

    messages = [(t, "/tf", make(i)) for i, t in enumerate(T)]
    written: Path = write_bag(path, kind, {"/tf": "tf2_msgs/msg/TFMessage"}, messages)
    return written


def columns(*names: str, **more: Any) -> dict[str, Any]:
    return {"columns": list(names), **more}


def _motive(version: str, unit: str) -> Callable[[Path], Made]:
    return lambda d: (motive(d / "take.csv", version, unit), columns("tool"), '["tool"]')


def _atracsys(kind: Kind) -> Callable[[Path], Made]:
    reference = "/atracsys/probe/measured_cp.pose"
    return lambda d: (bag(d / "lab", kind), columns(reference), f'["{reference}"]')


GALLERY: dict[str, Callable[[Path], Made]] = {
    "Motive 1.21 m": _motive("1.21", "Meters"),
    "Motive 1.23 mm": _motive("1.23", "Millimeters"),
    "Motive 1.24 cm": _motive("1.24", "Centimeters"),
    "Motive 1.25 m": _motive("1.25", "Meters"),
    "NDI": lambda d: (ndi(d / "polaris.csv", timed=True), columns("probe"), '["probe"]'),
    "NDI by frames": lambda d: (ndi(d / "polaris.csv", timed=False), columns("probe"), '["probe"]'),
    "TUM": lambda d: (
        table(d / "tum.txt", "", Q, separator=" "),
        columns(*(f"data[{i}]" for i in range(1, 8))),
        '"data[1]", "data[2]", "data[3]", "data[4]"',
    ),
    "TUM with a head": lambda d: (
        table(d / "tum.txt", "# timestamp tx ty tz qx qy qz qw", Q, separator=" "),
        columns("tx", "ty", "tz", "qx", "qy", "qz", "qw"),
        '["tx", "ty", "tz", "qx", "qy", "qz", "qw"]',
    ),
    "q0 first": lambda d: (
        table(d / "lab.csv", "time,x [mm],y [mm],z [mm],q0,qx,qy,qz", np.roll(Q, 1, axis=1), 1e3),
        columns("x [mm]", "y [mm]", "z [mm]", "q0", "qx", "qy", "qz", unit="mm", orientation="wxyz"),
        'orientation = "wxyz"',
    ),
    "rotation vectors": lambda d: (
        table(d / "ur.csv", "timestamp,tcp_x,tcp_y,tcp_z,tcp_rx,tcp_ry,tcp_rz", R.as_rotvec()),
        columns("tcp_x", "tcp_y", "tcp_z", "tcp_rx", "tcp_ry", "tcp_rz", orientation="vector"),
        'orientation = "vector"  # axis times angle, as a UR says its tool, or angles about axes',
    ),
    "roll, pitch, yaw": lambda d: (
        table(d / "rpy.csv", "t,x,y,z,roll,pitch,yaw", np.rad2deg(R.as_euler("xyz")), clock=0.0),
        columns("x", "y", "z", "roll", "pitch", "yaw", orientation="xyz", angle_unit="deg"),
        'orientation = "xyz"  # turns about fixed axes, roll first',
    ),
    "yaw, pitch, roll": lambda d: (
        table(d / "rpy.csv", "t,x,y,z,yaw,pitch,roll", R.as_euler("ZYX"), clock=0.0),
        columns("x", "y", "z", "yaw", "pitch", "roll", orientation="ZYX"),
        "of another order",
    ),
    **{f"Atracsys {kind}": _atracsys(kind) for kind in KINDS},
}  # fmt: skip


def read(source: Path, said: dict[str, Any]) -> tuple[Floats, Floats | None]:
    sources, tracked = Sources([source]), TrackedPose(**said)
    places = pose_places(tracked, sources.streams)
    stream = sources.read({places[0].stream: [place.column for place in places]})[places[0].stream]
    return positions_and_rotations(tracked, np.column_stack([stream.columns[place.column] for place in places]))


@pytest.mark.parametrize("name", list(GALLERY))
def test_a_pose_is_read_in_metres_and_missing_ones_are_no_zeros(name: str, tmp_path: Path) -> None:
    source, said, proposed = GALLERY[name](tmp_path)
    position, rotation = read(source, said)
    seen = ~np.isin(np.arange(ROWS), LOST)
    assert np.isnan(position[~seen]).all()
    assert_allclose(position[seen], P[seen], atol=1e-8)  # nine digits in the file
    assert rotation is not None
    assert_allclose(rotation[seen], R.as_matrix()[seen], atol=1e-7)
    proposal = propose_mapping(source)
    assert proposed in proposal.toml
    assert any("tells where the joints were" in question for question in proposal.questions)
    taken = [line for line in proposal.toml.splitlines() if "columns" in line]
    assert not any("local/measured_cp" in line for line in taken)
    assert not any("PSM1/measured_cp" in line for line in taken)


@pytest.mark.parametrize("kind", KINDS[1:])  # rosbags has no TFMessage of ROS 1
def test_transforms_are_followed_by_child_each_with_its_own_stamp(kind: Kind, tmp_path: Path) -> None:
    source = transforms(tmp_path / "lab", kind)
    sources = Sources([source])
    reference = "/tf.transforms[probe/1].transform"
    assert f'["{reference}"]' in propose_mapping(source).toml  # and the base, which never moves, is none
    places = pose_places(TrackedPose(columns=(reference,)), sources.streams)
    stream = sources.read({"/tf": [place.column for place in places]})["/tf"]
    there = [i for i in range(ROWS) if i % 5 > 0 or i % 3 > 0]
    assert_allclose(np.column_stack([stream.columns[p.column] for p in places[:3]]), P[there], atol=1e-12)
    assert stream.stamp is not None
    assert stream.arrival is not None
    late = (stream.arrival - stream.stamp) / 1e9 - 0.002  # a message takes 2 ms to arrive
    assert_allclose(late, 0.2, atol=1e-6)
    assert (np.diff(stream.arrival) > 0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda d: motive(d / "take.csv", "1.23", "Furlongs"), "Length Units of meters, centimeters, millimeters, got fur"),
        (lambda d: write(d / "take.csv", ["Format Version,1.2,Length Units,Meters", "", "1,2,3"]), "lines of types, names"),
        (lambda d: write(d / "ndi.csv", ["Tools,Port 1,Frame,State,Rz,Ry,Rx,Tx,Ty,Tz", "1,Port 1,1,OK,0,0,0,1,2,3"]), "no Q0"),
    ],
)  # fmt: skip
def test_an_export_that_is_not_as_its_program_writes_it_is_refused(
    make: Callable[[Path], Path], message: str, tmp_path: Path
) -> None:
    with pytest.raises(FileFormatError, match=message):
        Sources([make(tmp_path)])


def test_eulers_angles_of_motive_are_left_out_and_said(tmp_path: Path) -> None:
    (stream,) = Sources([motive(tmp_path / "take.csv", "1.23", "Meters", turns="XYZ")]).streams
    assert "tool.orientation.x" not in stream.columns
    assert any("export them with Rotation Type: Quaternion" in note for note in stream.notes)


@pytest.mark.parametrize(
    ("said", "error", "message"),
    [
        (columns("x", "y", "z", "roll", "pitch", "yaw"), InputError, "6 columns with orientation"),
        (columns("x", "y"), InputError, "expected a message's pose, or three, six or seven"),
        (columns("x", "y", "z", "roll", "pitch", "yaw", orientation="XXZ"), ConfigError, "turns twice about one axis"),
        (columns("x", "y", "z", "roll", "pitch", "yaw", orientation="rpy"), ConfigError, "orientation"),
    ],
)
def test_a_pose_that_cannot_be_one_is_refused(
    said: dict[str, Any], error: type[Exception], message: str, tmp_path: Path
) -> None:
    source = table(tmp_path / "rpy.csv", "t,x,y,z,roll,pitch,yaw", R.as_euler("xyz"), clock=0.0)
    whole = {"robot": "two_link", "q_nominal": {"columns": ["x", "y"]}, "q_encoder": {"pose": said}}
    with pytest.raises(error, match=message):
        import_recording(source, whole)
