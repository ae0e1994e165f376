"""LeRobot's datasets as its versions 2 and 3 write them: names, rates, episodes, dates, and shares in place of angles."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import CatenaryError, FileFormatError, InputError
from catenary.recording.logs import read_log, write_parquet
from catenary.workflows.check import check_file
from catenary.workflows.import_recording import import_recording, propose_mapping
from gallery.containers import lerobot

JOINTS = ("waist", "shoulder_lift", "elbow", "wrist")
LENGTHS = (90, 1, 120)


def state(rows: int, episode: int) -> np.ndarray:
    t = np.arange(rows) / 30
    angles = [0.4 * np.sin(t * (1 + 0.3 * i) + episode + i) for i in range(len(JOINTS))]
    return np.column_stack(angles).astype(np.float32)


def dataset(
    path: Path, version: str = "v3.0", *, names: Any = JOINTS, scale: float = 1.0, lengths: tuple[int, ...] = LENGTHS,
    **changes: Any,
) -> Path:  # fmt: skip
    """Of version 3 several episodes a file, one of them in two."""
    episodes = []
    for episode, rows in enumerate(lengths):
        q, count = scale * state(rows, episode), np.arange(rows)
        told = q + np.float32(0.01 * scale) * np.sin(count.astype(np.float32))[:, None]
        times = (count / 30).astype(np.float32)
        index, task = count + 1000 * episode, np.zeros(rows, dtype=np.int64)
        columns = {"observation.state": q, "action": told, "timestamp": times, "index": index, "task_index": task}
        episodes.append(columns)
    return lerobot(path, version, episodes, names, split=100, fps=30, **changes)


def test_the_whole_dataset_and_its_episodes_are_known_by_the_same_hashes(tmp_path: Path) -> None:
    path, mapping = dataset(tmp_path / "pusht", lengths=(60, 100)), ["q_nominal=observation.state@rad"]
    whole = import_recording(path, mapping)
    known = [{"sha256": whole.sha256, "marks": whole.marks}]
    for episode in range(len(whole.starts)):
        log = import_recording(path / str(episode), mapping)
        write_parquet(log, tmp_path / "log.parquet")
        assert log.is_among(known)
        assert read_log(tmp_path / "log.parquet").is_among(known)
    other = dataset(tmp_path / "other", lengths=(60, 100), scale=1.1)
    assert not import_recording(other, mapping).is_among(known)


@pytest.mark.parametrize("version", ["v2.0", "v2.1", "v3.0"])
@pytest.mark.parametrize(
    "names", [list(JOINTS), {"motors": list(JOINTS)}, {"axes": list(JOINTS[:2]), "more": list(JOINTS[2:])}]
)
def test_all_episodes_stand_one_behind_the_other_with_the_names_of_the_joints(
    tmp_path: Path, version: str, names: Any
) -> None:
    path = dataset(tmp_path / "lab", version, names=names)
    proposal = propose_mapping(path, units="rad")
    assert "not what it was commanded (action)" in proposal.toml
    log = import_recording(path, accept_proposal=True, units="rad")
    assert (log.name, log.joint_names) == ("lab", JOINTS)
    expected = np.vstack([state(rows, k) for k, rows in enumerate(LENGTHS)])
    assert_array_equal(log.q_nominal, expected)
    assert_allclose(log.time, np.concatenate([np.arange(rows) / 30 for rows in LENGTHS]), atol=1e-6)
    assert any("3 episodes, one behind the other: episode_0, episode_1, episode_2" in note for note in log.notes)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("named", ["episode_2", "episode_000002", "2"])
def test_an_episode_alone_keeps_its_name_and_the_date_of_the_dataset(tmp_path: Path, version: str, named: str) -> None:
    path = dataset(tmp_path / "lab", version, date="2025-11-02T10:00:00+01:00")
    log = import_recording(path / named, ["q_nominal=observation.state@rad", "signal:command=action"])
    assert log.name == f"lab {named}"
    assert log.began == 1762074000.0
    assert_array_equal(log.q_nominal, state(120, 2))
    assert_allclose(log.time, np.arange(120) / 30, atol=1e-6)  # timestamps are of single precision
    assert check_file(str(path / named)).kind == "third-party recording"


def test_columns_of_names_that_do_not_fit_are_numbered_and_those_that_not_all_files_have_are_told(
    tmp_path: Path,
) -> None:
    path = dataset(tmp_path / "lab", names=["state"])
    later = path / "data" / "chunk-000" / "file-001.parquet"
    pq.write_table(pq.read_table(later).drop_columns(["task_index"]), later)
    log = import_recording(path / "0", ["q_nominal=observation.state[0:3]@rad"])
    assert log.joint_names == ("J1", "J2", "J3")
    assert any("left out, as not all files have them: task_index" in note for note in log.notes)


@pytest.mark.parametrize(("names", "scale"), [([f"{joint}.pos" for joint in JOINTS], 90.0), (list(JOINTS), 400.0)])
@pytest.mark.parametrize("robot", [None, "ur5e"])
def test_shares_of_a_range_are_no_angles(tmp_path: Path, names: list[str], scale: float, robot: str | None) -> None:
    """LeRobot's own arms record -100 to 100 % of each joint's range; a UR5e's limits hold such numbers as degrees."""
    path = dataset(tmp_path / "lab", names=names, scale=scale)
    if names == list(JOINTS):  # cut off at both ends of the range
        for file in (path / "data" / "chunk-000").iterdir():
            table = pq.read_table(file)
            clipped = np.clip(np.array(table["observation.state"].to_pylist(), dtype=np.float32), -100.0, 100.0)
            column = pa.FixedSizeListArray.from_arrays(pa.array(clipped.ravel()), len(JOINTS))
            pq.write_table(table.set_column(0, "observation.state", column), file)
    proposal = propose_mapping(path, robot=robot)
    assert any("shares of each joint's range, whose ends nobody states" in question for question in proposal.questions)
    with pytest.raises(InputError, match="not stated, and not clear"):
        import_recording(path, ["q_nominal=observation.state"])
    mapped = import_recording(
        path / "0",
        {"q_nominal": {"columns": "observation.state", "units": "counts", "scale": 0.02}, "joint_units": ["rad"] * 4},
    )
    assert np.abs(mapped.q_nominal).max() <= 0.02 * 100.0


@pytest.mark.parametrize("joint", ["shoulder_lift_joint", "shoulder_lift"])
def test_a_shoulder_that_lifts_turns(tmp_path: Path, joint: str) -> None:
    log = import_recording(
        dataset(tmp_path / "lab", names=["pan", joint, "elbow", "wrist"]), accept_proposal=True, units="rad"
    )
    assert log.joint_units == ("rad",) * 4
    assert 'units = ["rad", "rad"' in propose_mapping(tmp_path / "lab").toml


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"codebase_version": "v1.6"}, "is LeRobot's v1.6.*versions 2 and 3 are read"),
        ({"codebase_version": None}, "is LeRobot's None"),
    ],
)
def test_what_is_no_dataset_of_a_known_version_is_refused(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(CatenaryError, match=words):
        import_recording(dataset(tmp_path / "lab", **changes), ["q_nominal=observation.state@rad"])


def test_a_damaged_file_and_a_missing_episode_are_told(tmp_path: Path) -> None:
    path = dataset(tmp_path / "lab")
    with pytest.raises(FileFormatError, match='no episode "7"; its episodes are episode_0, episode_1, episode_2'):
        import_recording(path / "7", ["q_nominal=observation.state@rad"])
    (path / "data" / "chunk-000" / "file-001.parquet").write_bytes(b"PAR1" + bytes(50))
    with pytest.raises(FileFormatError, match=r"file-001\.parquet: cannot be read as Parquet"):
        import_recording(path, ["q_nominal=observation.state@rad"])
