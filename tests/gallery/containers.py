"""Containers of many recordings, what other encodings and programs write, and files that nothing here reads."""

import gzip
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import QD, TAU, Q, Sample, T

NAMES = ["shoulder_pan", "shoulder_lift", "rail"]


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


def lerobot(path: Path, version: str) -> None:
    folder = path / "data" / "chunk-000"
    folder.mkdir(parents=True)
    (path / "meta").mkdir()
    features = {"observation.state": {"names": {"motors": NAMES}}}
    (path / "meta" / "info.json").write_text(
        json.dumps({"codebase_version": version, "fps": 100, "features": features})
    )
    state = pa.FixedSizeListArray.from_arrays(pa.array(Q.ravel()), 3)
    table = pa.table({"observation.state": state, "timestamp": T, "episode_index": np.zeros(len(T), dtype=int)})
    pq.write_table(table, folder / ("episode_000000.parquet" if version < "v3" else "file-000.parquet"))


def packed(path: Path) -> None:
    rows = "\n".join(",".join(map(repr, row)) for row in np.column_stack([T, Q]).tolist())
    path.write_bytes(gzip.compress(f"t,q1,q2,q3\n{rows}\n".encode()))


SAMPLES = [
    Sample("robosuite, robomimic", "lift.hdf5", "episodes, by their attributes' rate; images are left out", robomimic),
    Sample("ALOHA", "episode_0.hdf5", "qpos, qvel, effort", aloha, truth={"q_nominal": Q, "tau": TAU, "time": T}),
    Sample(
        "MATLAB `save -v7.3`", "v73.mat", "as older versions", matlab, truth={"q_nominal": Q, "tau": TAU, "time": T}
    ),
    Sample("LeRobot 2", "pusht2", "joints by the names of the features", lambda path: lerobot(path, "v2.1")),
    Sample("LeRobot 3", "pusht3", "likewise", lambda path: lerobot(path, "v3.0")),
    Sample("gzip", "run.csv.gz", "as the plain one", packed),
    Sample(
        "Excel",
        "lab.xlsx",
        "",
        lambda path: path.write_bytes(b"PK\x03\x04"),
        refused="is a spreadsheet: save its sheet as CSV",
    ),
    Sample(
        "Python's pickle",
        "lab.pkl",
        "",
        lambda path: path.write_bytes(b"\x80"),
        refused="is a pickle, which runs what it holds",
    ),
]
