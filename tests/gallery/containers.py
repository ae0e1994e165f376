"""Containers of many recordings, what other encodings and programs write, and files that nothing here reads."""

import gzip
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import QD, TAU, Q, Sample, T

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


SAMPLES = [
    Sample("robosuite, robomimic", "lift.hdf5", "episodes, by their attributes' rate; images are left out", robomimic),
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
    Sample("Python's pickle", "lab.pkl", "", Path.touch, refused="is a pickle, which runs what it holds"),
]
