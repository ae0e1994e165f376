"""HDF5 in the shapes that robomimic, ALOHA and MATLAB write, and files made to do harm."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError, MissingPackageError
from catenary.recording.import_formats.episode_files import read_hdf5
from catenary.workflows.import_recording import import_recording, propose_mapping
from gallery.containers import matlab

h5py = pytest.importorskip("h5py", reason="needs h5py, which the extra hdf5 brings")

LENGTHS = (60, 100, 80)  # rows of three episodes


def joints(rows: int, count: int, phase: float = 0.0) -> np.ndarray:
    t = np.arange(rows) / 20
    return np.column_stack([0.4 * np.sin(t * (1 + 0.3 * i) + phase + i) for i in range(count)])


def robomimic(path: Path, **changes: Any) -> Path:
    """As robosuite collects demonstrations, and robomimic keeps them."""
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        attributes = {
            "env_args": json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 20}}),
            "date": "3-14-2024",
            "time": "10:3:22",
            "total": sum(LENGTHS),
        } | changes
        for key, value in attributes.items():
            data.attrs[key] = value
        for number, rows in zip((0, 2, 10), LENGTHS, strict=True):
            demo = data.create_group(f"demo_{number}")
            demo.attrs["model_file"] = "<mujoco/>"
            demo["actions"] = np.full((rows, 7), 0.1) * np.arange(rows)[:, None]
            demo["obs/robot0_joint_pos"] = joints(rows, 7, number)
            demo["obs/robot0_joint_vel"] = np.gradient(joints(rows, 7, number), 0.05, axis=0)
            demo["obs/robot0_joint_pos_cos"] = np.cos(joints(rows, 7, number))
            demo["obs/robot0_eef_pos"] = joints(rows, 3)
            demo["obs/agentview_image"] = np.zeros((rows, 4, 4, 3), dtype=np.uint8)
        file["mask/train"] = np.array([b"demo_0"])
    return path


def test_episodes_of_robomimic_stand_one_behind_the_other_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    log = import_recording(robomimic(tmp_path / "lift.hdf5"), ["q_nominal=obs/robot0_joint_pos@rad"])
    assert log.starts == (0, 60, 160)
    expected = np.vstack([joints(rows, 7, k) for k, rows in zip((0, 2, 10), LENGTHS, strict=True)])
    assert_array_equal(log.q_nominal, expected)
    assert_allclose(log.time, np.concatenate([np.arange(rows) / 20 for rows in LENGTHS]), atol=1e-9)
    told = " ".join(log.notes)
    assert "3 episodes, one behind the other: data/demo_0, data/demo_2, data/demo_10" in told
    assert "agentview_image (of shape (60, 4, 4, 3), no rows of numbers)" in told
    assert "time goes back" not in told


@pytest.mark.parametrize("named", ["data/demo_10", "demo_10", "demo_0010", "10"])
def test_an_episode_alone_keeps_its_name_and_date(tmp_path: Path, named: str) -> None:
    path = robomimic(tmp_path / "lift.hdf5")
    log = import_recording(path / named, ["q_nominal=obs/robot0_joint_pos@rad", "qd=obs/robot0_joint_vel"])
    assert log.name == f"lift {named.rpartition('/')[2]}"
    assert log.began == 1710410602.0  # 2024-03-14 10:03:22 UTC
    assert_array_equal(log.q_nominal, joints(80, 7, 10))
    assert log.starts == (0,)
    assert log.sha256 != import_recording(path / "demo_2", ["q_nominal=obs/robot0_joint_pos@rad"]).sha256


def test_episodes_of_one_container_are_told_with_their_own_dates_and_stay_recordings_of_their_own(
    tmp_path: Path,
) -> None:
    """Time begins anew with each, by which a model's memory of a cable does, too; the log's date is the first's."""
    path = robomimic(tmp_path / "lift.hdf5")
    dates = {"demo_0": 1710410602.0, "demo_2": 1710410702.0, "demo_10": 1700000000.0}
    with h5py.File(path, "a") as file:
        for name, date in dates.items():
            file[f"data/{name}"].attrs["start_time"] = date
        del file["data"].attrs["date"]
    log = import_recording(path, ["q_nominal=obs/robot0_joint_pos@rad"])
    assert (log.began, log.starts) == (dates["demo_0"], (0, 60, 160))
    told = "demo_0 (2024-03-14 10:03:22), data/demo_2 (2024-03-14 10:05:02), data/demo_10 (2023-11-14 22:13:20)"
    assert told in " ".join(log.notes)
    assert import_recording(path / "demo_10", ["q_nominal=obs/robot0_joint_pos@rad"]).began == dates["demo_10"]


def test_episodes_whose_clock_goes_on_begin_anew_all_the_same(tmp_path: Path) -> None:
    """Stamps since 1970 rise from episode to episode: what a model remembers of one is nothing in the next."""
    path, begin = robomimic(tmp_path / "lift.hdf5"), 1.7e9
    with h5py.File(path, "a") as file:
        for number, rows in zip((0, 2, 10), LENGTHS, strict=True):
            file[f"data/demo_{number}/obs/stamp"] = begin + 100.0 * number + np.arange(rows) / 20
    log = import_recording(path, ["q_nominal=obs/robot0_joint_pos@rad", "time=obs/stamp"])
    assert (log.began, log.starts) == (begin, (0, 60, 160))
    assert_allclose(log.time, np.concatenate([np.arange(rows) / 20 for rows in LENGTHS]), atol=1e-6)


@pytest.mark.parametrize(
    ("date", "time", "began"),
    [
        ("2024-03-14", "10:03:22", 1710410602.0),
        ("2024-03-14T10:03:22+02:00", None, 1710403402.0),
        ("12-31-1999", None, 946598400.0),
        ("one day", None, 0.0),
        ("31-12-1999", None, 0.0),
    ],
)
def test_dates_are_taken_as_they_are_written(tmp_path: Path, date: str, time: str | None, began: float) -> None:
    path = robomimic(tmp_path / "lift.hdf5", date=date, time=time or "none")
    assert import_recording(path / "0", ["q_nominal=obs/robot0_joint_pos@rad"]).began == began


def test_an_episode_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r'no episode "demo_1"; its episodes are data/demo_0, data/demo_2'):
        import_recording(robomimic(tmp_path / "lift.hdf5") / "demo_1", ["q_nominal=obs/robot0_joint_pos"])
    with pytest.raises(FileFormatError, match="no such file"):
        import_recording(tmp_path / "none.hdf5" / "demo_1", ["q_nominal=q"])


def test_arms_that_are_numbered_are_no_episodes(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        for arm in ("PSM1", "PSM2"):
            file[f"{arm}/measured_js"] = joints(100, 6)
    (stream,) = read_hdf5(tmp_path / "lab.h5")
    assert {name.partition("[")[0] for name in stream.columns} == {"PSM1/measured_js", "PSM2/measured_js"}


def test_names_of_joints_and_other_texts_are_texts(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        file["q"], file["joint_names"] = joints(100, 3), ["a", "b", "c"]
        file.attrs["fps"] = 50
    mapping = {"q_nominal": {"columns": "q", "units": "rad"}, "names_in": "joint_names"}
    log = import_recording(tmp_path / "lab.h5", mapping)
    assert log.joint_names == ("a", "b", "c")
    assert log.time[-1] == pytest.approx(99 / 50)


def outward(file: Any, folder: Path) -> None:
    (folder / "secret.csv").write_bytes(np.arange(300.0).tobytes())
    file["q"] = joints(100, 3)
    file["link"] = h5py.ExternalLink(str(folder / "secret.h5"), "/x")
    file["soft"] = h5py.SoftLink("/q")
    file.create_dataset("raw", (100,), dtype="f8", external=[(str(folder / "secret.csv"), 0, 800)])
    layout = h5py.VirtualLayout((100,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "x", shape=(100,))
    file.create_virtual_dataset("virtual", layout)


def test_nothing_is_read_outside_the_file(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        outward(file, tmp_path)
    (stream,) = read_hdf5(tmp_path / "lab.h5")
    assert set(stream.columns) == {"q[0]", "q[1]", "q[2]"}
    for name in ("raw (its numbers", "virtual (its numbers"):
        assert name in stream.notes[0]


def test_a_group_within_itself_is_read_once(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        group = file.create_group("a")
        for i in range(50):
            group[f"again_{i}"] = group  # 50 ** 8 paths
        group["q"] = joints(100, 3)
    (stream,) = read_hdf5(tmp_path / "lab.h5")
    assert len(stream.columns) == 3


HARMFUL: dict[str, tuple[Callable[[Any], object], str]] = {
    "huge": (lambda f: f.create_dataset("q", (10**12, 3), dtype="f8", chunks=(1000, 3)), "more than its file can hold"),
    "negative": (lambda f: f.create_dataset("q", (2**62, 1), dtype="i1", chunks=(1000, 1)), "more than its file"),
    "wide": (lambda f: f.create_dataset("q", (20_000, 20_000), dtype="i1", chunks=(100, 100)), "more than its file"),
    "many": (lambda f: [f.create_group(f"g{i}") for i in range(60)], "more than 50 groups and arrays"),
    "nothing": (lambda f: f.create_group("a"), "holds no row of numbers"),
    "structures": (lambda f: f.create_dataset("q", data=[(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")]), "holds"),
    "references": (lambda f: f.create_dataset("q", (5,), dtype=h5py.ref_dtype), "neither numbers nor texts"),
    "lists": (lambda f: f.create_dataset("q", (5,), dtype=h5py.vlen_dtype(np.float64)), "holds no row of numbers"),
    "empty": (lambda f: f.create_dataset("q", data=h5py.Empty("f8")), "empty"),
    "no JSON": (lambda f: [f.create_dataset("q", data=joints(9, 2)), f.attrs.update({"env_args": "{"})], "env_args"),
}


@pytest.mark.parametrize("name", HARMFUL)
def test_a_file_that_asks_for_more_than_it_holds_is_refused(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, words = HARMFUL[name]
    monkeypatch.setattr("catenary.recording.import_formats.episode_files._MAX_NODES", 50)
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        make(file)
    with pytest.raises((FileFormatError, InputError), match=words):
        read_hdf5(tmp_path / "lab.h5")


@pytest.mark.parametrize("keep", [9, 100, 700, 0.5, 0.99])
def test_a_file_that_was_cut_off_is_refused_by_name(tmp_path: Path, keep: float) -> None:
    data = robomimic(tmp_path / "lift.hdf5").read_bytes()
    (tmp_path / "cut.hdf5").write_bytes(data[: int(keep * len(data)) if keep < 1 else int(keep)])
    with pytest.raises(FileFormatError, match=r"cut\.hdf5: cannot be read as HDF5"):
        import_recording(tmp_path / "cut.hdf5", ["q_nominal=q"])


def test_without_h5py_the_extra_and_other_ways_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matlab(path := tmp_path / "lab.mat")
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(MissingPackageError, match=r"is HDF5, which needs h5py.*'-v7'.*pip install 'h5py"):
        propose_mapping(path)


def test_groups_nested_in_thousands_are_refused_at_once(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "deep.h5", "w") as file:
        group = file
        for _ in range(3000):
            group = group.create_group("g")
    begin = time.process_time()
    with pytest.raises(FileFormatError, match="nested more than 64 levels deep"):
        read_hdf5(tmp_path / "deep.h5")
    assert time.process_time() - begin < 2.0


@pytest.mark.parametrize("where", ["cam", "obs/cam"])
def test_a_link_to_another_file_is_not_followed_and_said(tmp_path: Path, where: str) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["cam"] = joints(100, 3)
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        file["q"], file[where] = joints(100, 3), h5py.ExternalLink("other.h5", "/cam")
        file["again"] = h5py.SoftLink("/q")
    (stream,) = read_hdf5(tmp_path / "lab.h5")
    assert list(stream.columns) == ["q[0]", "q[1]", "q[2]"]
    assert f"left out: {where} (stands in other.h5, which is not read)" in stream.notes


@pytest.mark.parametrize(
    ("units", "factor"),
    [
        ("deg", np.degrees(1)), (b"degrees", np.degrees(1)), ("Radians", 1.0),
        (["deg", "rad", "deg"], np.array([np.degrees(1), 1.0, np.degrees(1)])),
    ],
)  # fmt: skip
@pytest.mark.parametrize("name", ["units", "Units", "unit"])
def test_units_in_attributes_are_those_of_a_csvs_head(tmp_path: Path, units: object, factor: object, name: str) -> None:
    with h5py.File(tmp_path / "lab.h5", "w") as file:
        file["time"], file["q"], file["v"] = np.arange(100) * 50, joints(100, 3) * factor, joints(100, 3)
        file["time"].attrs[name], file["q"].attrs[name], file["v"].attrs[name] = "milliseconds", units, "rad/s"
    proposal = propose_mapping(tmp_path / "lab.h5")
    assert not proposal.questions
    log = import_recording(tmp_path / "lab.h5", accept_proposal=True)
    assert_allclose(log.q_nominal, joints(100, 3), atol=1e-12)
    assert_allclose(log.qd, joints(100, 3), atol=1e-12)
    assert_allclose(log.time, np.arange(100) * 0.05, atol=1e-12)
