"""Poses as trackers and their programs write them: each file small and made here, its poses known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from tests.lab_bags import JOINT_STATE, KINDS, POSE, Kind, Message, header, joint_state, pose, write_bag

from . import Sample

ROWS = 40
TIME = 0.05 * np.arange(ROWS)
P = np.column_stack([0.1 * np.sin(TIME), 0.2 * np.cos(2.0 * TIME), 1.0 + 0.1 * TIME])  # [m]
R = Rotation.from_euler("ZYX", np.column_stack([0.5 * np.sin(TIME), 0.3 * np.cos(TIME), 1.0 + 0.2 * TIME]))
TURNS = R.as_quat()  # x, y, z, w
LOST = np.arange(10, 14)  # rows on which the tracker saw nothing
PREFIXED = ("x_mm", "y_mm", "z_mm", "q0", "qx", "qy", "qz")
WORDED = [f"probe_pos_{axis}" for axis in "xyz"] + [f"probe_quat_{axis}" for axis in "xyzw"]
UNIT = {"Meters": 1.0, "Furlongs": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}


def write(path: Path, lines: list[str]) -> Path:
    """Write lines."""
    path.write_text("\n".join(lines) + "\n")
    return path


def motive(path: Path, version: str, unit: str, *, turns: str = "Quaternion") -> Path:
    """Motive's export of a body, one of its markers and one that has no name, as its versions write it."""
    labelled = version == "1.25"
    turned = TURNS if turns == "Quaternion" else R.as_euler(turns, degrees=True)  # capitals: about its own axes
    k = turned.shape[1]
    words = ("Type", "Name", "ID", "Parent") if labelled else ("", "", "", "")
    body, marker, stray = ["Rigid Body"] * (k + 4), ["Rigid Body Marker"] * 3, ["Marker"] * 3
    names = ["tool"] * (k + 4) + ["tool:Marker1"] * 3 + ["Unlabeled 12"] * 3
    rows = [
        ["", words[0], *body, *marker, *stray],
        ["", words[1], *names],
        ["", words[2], *['"1:2"'] * (k + 10)],
        *[["", words[3], *[""] * (k + 10)]] * labelled,
        ["", "", *["Rotation"] * k, *["Position"] * 3, "Mean Marker Error", *["Position"] * 6],
        ["Frame", "Time (Seconds)", *"XYZW"[:k], *"XYZ", "", *"XYZ", *"XYZ"],
    ]
    settings = f"Format Version,{version},Take Name,a,Capture Frame Rate,20.0,Rotation Type,{turns},Length Units,{unit}"
    lines = [settings, "", *(",".join(map(str, row)) for row in rows)]
    for i in range(ROWS):
        numbers = [*turned[i], *UNIT[unit] * P[i], 0.0002, *UNIT[unit] * (P[i] + 0.01)]
        cells = [""] * (k + 10) if i in LOST else [*(f"{number:.9f}" for number in numbers), "", "", ""]
        lines.append(",".join([str(i), f"{TIME[i]:.6f}", *cells]))
    return write(path, lines)


def ndi(path: Path) -> object:
    """NDI's export of a tool: in mm, a tool that is not seen with numbers beyond all."""
    lines = ["Tools,Port 1,Frame,Face,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error"]
    for i in range(ROWS):
        x, y, z, w = TURNS[i]
        full = ["OK", *(f"{v:.9f}" for v in (w, x, y, z, *1e3 * P[i])), "0.2"]
        full = ["MISSING", *["0"] * 4, *["-3.697314e+28"] * 3, ""] if i in LOST else full
        lines.append(",".join(["1", "probe", str(1000 + 3 * i), "1", *full]))
    return write(path, lines)


def table(
    path: Path, names: str, turns: Floats, scale: float = 1.0, separator: str = ",", clock: float = 1.7e9
) -> Path:
    """A table of time, position and orientation; rows that were not seen are empty."""
    rows = [[clock + TIME[i], *scale * P[i], *turns[i]] for i in range(ROWS)]
    lines = [separator.join(f"{v:.9f}" for v in row) for row in rows]
    for i in LOST:
        lines[i] = separator.join([f"{rows[i][0]:.9f}", *["nan"] * (len(rows[i]) - 1)])
    return write(path, ([names] if names else []) + lines)


def bag(path: Path, kind: Kind) -> Path:
    """An Atracsys behind CRTK's topics beside a PSM, whose own pose and goal are no measurement."""
    messages: list[Message] = []
    for i, t in enumerate(TIME):
        seen = np.where(i in LOST, 0.0, P[i])
        x, y, z, w = TURNS[i]
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
                own = header(store, stamp, ros1=kind == "ros1")
                at = P[i] if child != "base" else np.ones(3)
                vector = types["geometry_msgs/msg/Vector3"](*map(float, at))
                turn = types["geometry_msgs/msg/Quaternion"](*map(float, TURNS[i] if child != "base" else (0, 0, 0, 1)))
                transform = types["geometry_msgs/msg/Transform"](vector, turn)
                made.append(types["geometry_msgs/msg/TransformStamped"](own, child, transform))
            return types["tf2_msgs/msg/TFMessage"](made)

        return message

    messages = [(t, "/tf", make(i)) for i, t in enumerate(TIME)]
    written: Path = write_bag(path, kind, {"/tf": "tf2_msgs/msg/TFMessage"}, messages)
    return written


def _motive(version: str, unit: str) -> Sample:
    return Sample(
        f"OptiTrack Motive {version}, {unit}", f"take{version}.csv",
        "bodies and named markers by their names, in m" if version == "1.21" else "likewise",
        lambda path: motive(path, version, unit), pose="tool", says=('["tool"]',),
    )  # fmt: skip


def _crtk(kind: Kind) -> Sample:
    reference = "/atracsys/probe/measured_cp.pose"
    return Sample(
        f"NDI, Atracsys over CRTK ({kind})", "crtk_ros1.bag" if kind == "ros1" else f"crtk_{kind}",
        "a tracker's `measured_cp`; the arm's own is left out" if kind == "ros1" else "likewise",
        lambda path: bag(path.with_suffix(""), kind), pose=reference, says=(f'["{reference}"]',),
    )  # fmt: skip


def _transforms(kind: Kind) -> Sample:
    reference = "/tf.transforms[probe/1].transform"
    return Sample(
        f"`/tf` ({kind})", "tf_ros1.bag" if kind == "ros1" else f"tf_{kind}",
        "transforms by child frame, each with its own stamp" if kind == "ros1" else "likewise",
        lambda path: transforms(path.with_suffix(""), kind), pose=reference, says=(f'["{reference}"]',),
    )  # fmt: skip


SAMPLES = [
    *(_motive(*each) for each in (("1.21", "Meters"), ("1.23", "Millimeters"), ("1.24", "Centimeters"), ("1.25", "Meters"))),
    *map(_crtk, KINDS),
    *map(_transforms, KINDS),
    Sample(
        "NDI ToolTracker (Polaris)", "polaris.csv", "position and quaternion of the first tool; the rate is to be said",
        ndi, pose="Tx", says=('orientation = "wxyz"',),
    ),
    Sample(
        "TUM's trajectories", "tum.txt", "a pose by number, recognised by its quaternion",
        lambda path: table(path, "", TURNS, separator=" "), pose="data[1]",
        says=('"data[1]", "data[2]", "data[3]", "data[4]"',),
    ),
    Sample(
        "TUM's trajectories with a head", "tum_head.txt", "position and quaternion by their names",
        lambda path: table(path, "# timestamp tx ty tz qx qy qz qw", TURNS, separator=" "),
        pose="tx", says=('["tx", "ty", "tz", "qx", "qy", "qz", "qw"]',),
    ),
    Sample(
        "Polaris, a lab's logger", "polaris_lab.csv", "q0 first; mm by the names",
        lambda path: table(path, "time,x [mm],y [mm],z [mm],q0,qx,qy,qz", np.roll(TURNS, 1, axis=1), 1e3),
        pose="x [mm]",
        says=('orientation = "wxyz"',),
    ),
    Sample(
        "Universal Robots' RTDE", "ur.csv", "rotation vectors; that they may be angles is said",
        lambda path: table(path, "timestamp,tcp_x,tcp_y,tcp_z,tcp_rx,tcp_ry,tcp_rz", R.as_rotvec()), pose="tcp_x",
        says=('orientation = "vector"  # axis times angle, as a UR says its tool, or angles about axes',),
    ),
    Sample(
        "a logger of roll, pitch, yaw", "rpy.csv", "angles about fixed axes",
        lambda path: table(path, "t,x,y,z,roll,pitch,yaw", np.rad2deg(R.as_euler("xyz")), clock=0.0), pose="x",
        says=('angle_unit = "deg"', 'orientation = "xyz"  # turns about fixed axes, roll first',),
    ),
    Sample(
        "a logger of yaw, pitch, roll", "ypr.csv", "angles; that the order may be another is said",
        lambda path: table(path, "t,x,y,z,yaw,pitch,roll", R.as_euler("ZYX"), clock=0.0),
        pose="x", says=("of another order",),
    ),
    Sample(
        "OptiTrack Motive, XYZ", "take_xyz.csv", "angles, as turns about the body's own axes",
        lambda path: motive(path, "1.23", "Millimeters", turns="XYZ"), pose="tool", says=("X then Y then Z",),
    ),
    Sample(
        "a tracker's columns with a prefix", "prefix.csv", "mm and the scalar of the quaternion by the names",
        lambda path: table(path, "time," + ",".join(f"tracker_{c}" for c in PREFIXED), np.roll(TURNS, 1, axis=1), 1e3),
        pose="tracker_x_mm", says=('unit = "mm"',),
    ),
    Sample(
        "a logger of pos_x, quat_x", "words.csv", "position and quaternion by their names",
        lambda path: table(path, "t," + ",".join(WORDED), TURNS), pose=WORDED[0], says=('"probe_quat_w"',),
    ),
    Sample(
        "KUKA's A, B, C", "kuka.csv", "turns about z, y, x in degrees; that the order may be another is said",
        lambda path: table(path, "t,tool_x,tool_y,tool_z,tool_a,tool_b,tool_c", R.as_euler("ZYX", degrees=True), 1e3),
        pose="tool_x",
        says=('unit = "mm"', 'angle_unit = "deg"', "as KUKA has them"),
    ),
]  # fmt: skip
