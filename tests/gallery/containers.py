"""Containers of many recordings, what other encodings and programs write, and files that nothing here reads."""

import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import QD, SEEN, TAU, Q, Sample, T

JOINTS = ("yaw", "pitch", "insertion")

STATES, MOTORS = [{"observation.state": Q, "timestamp": T}], {"motors": ["shoulder_pan", "shoulder_lift", "rail"]}


def robomimic(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_kwargs": {"control_freq": 100}})
        data["demo_0/obs/robot0_joint_pos"], data["demo_0/obs/robot0_joint_vel"] = Q, QD
        data["demo_0/obs/image"] = np.zeros((len(Q), 2, 2, 3), dtype=np.uint8)


def aloha(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["fps"] = 100
        file["observations/qpos"], file["observations/qvel"], file["observations/effort"] = Q, QD, TAU


def matlab(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": T[:, None], "q": Q, "tau": TAU}.items():
            file[name] = values.T
            file[name].attrs["MATLAB_class"] = np.bytes_(b"double")


def lerobot(
    path: Path, version: str, episodes: Sequence[Mapping[str, Any]], names: Any, split: int = 10**6, **info: Any
) -> Path:
    """Write a dataset of columns (N,) or (N, k), these by `names`: a file an episode, or of version 3 two split there."""
    folder, tables = path / "data" / "chunk-000", []
    folder.mkdir(parents=True)
    (path / "meta").mkdir()
    for number, columns in enumerate(episodes):
        lists = {
            key: v if np.ndim(v) == 1 else pa.FixedSizeListArray.from_arrays(pa.array(v.ravel()), v.shape[1])
            for key, v in columns.items()
        }
        rows = np.arange(len(next(iter(columns.values()))))
        tables.append(pa.table(lists | {"episode_index": np.full(len(rows), number), "frame_index": rows}))
    features = {key: {"names": names if np.ndim(v) == 2 else None} for key, v in episodes[0].items()}
    info = {"codebase_version": version, "fps": 100, "features": features} | info
    (path / "meta" / "info.json").write_text(json.dumps(info))
    if version < "v3":
        for number, table in enumerate(tables):
            pq.write_table(table, folder / f"episode_{number:06d}.parquet")
    else:
        whole = pa.concat_tables(tables)
        for number, part in enumerate([whole.slice(0, split), whole.slice(split)]):
            if part.num_rows:
                pq.write_table(part, folder / f"file-{number:03d}.parquet")
    return path


def packed(path: Path) -> None:
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack([T, Q]).tolist())
    path.write_bytes(gzip.compress(f"t,q1,q2,q3\n{rows}\n".encode()))


def droid(path: Path) -> None:
    import h5py

    whole = (100 * T).round().astype(np.int64)
    with h5py.File(path, "w") as file:
        state = file.create_group("observation/robot_state")
        state["joint_positions"], state["joint_velocities"], state["gripper_position"] = Q, QD, 0.5 + 0.4 * np.sin(T)
        file["action/joint_position"], file["action/gripper_position"] = Q + 0.01, 0.5 + 0.4 * np.sin(T)
        stamps = file.create_group("observation/timestamp/robot_state")
        stamps["robot_timestamp_seconds"], stamps["robot_timestamp_nanos"] = (
            1_700_000_000 + whole // 100,
            whole % 100 * 10**7,
        )
        stamps["read_start"] = stamps["read_end"] = 1_700_000_000_000 + 10 * whole


OWN = {
    "lab/msg/Point": "float64[] positions\nfloat64[] velocities\nfloat64[] effort\n",
    "control_msgs/msg/JointTrajectoryControllerState": "std_msgs/Header header\nstring[] joint_names\n"
    "lab/Point desired\nlab/Point actual\nlab/Point error\n",
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": "std_msgs/Header header\nstring[] joint_names\n"
    "control_msgs/InterfaceValue[] interface_values\n",
}


def bag(topic: str, kind: str, message: Callable[[Any, int], Sequence[Any]]) -> Callable[[Path], object]:
    """Return what writes a topic's messages, all that is behind the header given by the row."""

    def make(i: int) -> Callable[[Any, Any], Any]:
        return lambda store, head: store.types[kind](head, list(JOINTS), *message(store.types, i))

    def write(path: Path) -> object:
        from lab_bags import write_bag  # of the tests' own folder, which the page's maker does not need

        return write_bag(
            path, "ros1", {topic: kind}, [(t, topic, make(i)) for i, t in enumerate(T.tolist())], types=OWN
        )

    return write


def controlled(types: Any, i: int) -> Sequence[Any]:
    point, none = types["lab/msg/Point"], np.zeros(0)
    return [point(Q[i], QD[i], none), point(SEEN[i], QD[i], none), point(SEEN[i] - Q[i], none, none)]


def by_interface(types: Any, i: int) -> Sequence[Any]:
    value, names = types["control_msgs/msg/InterfaceValue"], ["position", "velocity", "effort"]
    return [[value(names, np.array(row)) for row in zip(Q[i], QD[i], TAU[i], strict=True)]]


SAMPLES = [
    Sample("robosuite, robomimic", "lift.hdf5", "episodes, by their attributes' rate; images are left out", robomimic),
    Sample(
        "DROID", "trajectory.h5", "joints; seconds and nanoseconds", droid, truth={"q_nominal": Q, "qd": QD, "time": T}
    ),
    Sample(
        "ros_control's JointTrajectoryControllerState",
        "controller.bag",
        "as named columns",
        bag("/arm_controller/state", "control_msgs/msg/JointTrajectoryControllerState", controlled),
        asks={"q_encoder": "actual"},
        truth={"q_nominal": Q, "q_encoder": SEEN},
    ),
    Sample(
        "ros2_control's DynamicJointState",
        "dynamic.bag",
        "its interfaces",
        bag("/dynamic_joint_states", "control_msgs/msg/DynamicJointState", by_interface),
        truth={"q_nominal": Q, "qd": QD, "tau": TAU},
    ),
    Sample("ALOHA", "episode_0.hdf5", "qpos, qvel, effort", aloha, truth={"q_nominal": Q, "tau": TAU, "time": T}),
    Sample(
        "MATLAB `save -v7.3`", "v73.mat", "as older versions", matlab, truth={"q_nominal": Q, "tau": TAU, "time": T}
    ),
    Sample(
        "LeRobot 2", "pusht2", "joints by the names of the features", lambda path: lerobot(path, "v2.1", STATES, MOTORS)
    ),
    Sample("LeRobot 3", "pusht3", "likewise", lambda path: lerobot(path, "v3.0", STATES, MOTORS)),
    Sample("gzip", "run.csv.gz", "as the plain one", packed),
    Sample("Excel", "lab.xlsx", "", Path.touch, refused="is a spreadsheet: save its sheet as CSV"),
    Sample("Python's pickle", "lab.pkl", "", Path.touch, refused="is a pickle, which may run code"),
]
