"""Recordings of a project that were interrupted: what is whole is taken, what is lost is said, others go on."""

import json
from pathlib import Path

import pytest

from catenary.errors import InputError
from catenary.recording.bag_stream import BagStream
from catenary.recording.logs import read_log
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.recordings import extract_recording, motion_log_path, write_bags
from command_line import catenary
from oracles.raven_recording import record


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """With a whole recording."""
    project = Project(tmp_path / "p", ProjectSettings())
    folder = project.folder / "recordings" / "whole"
    project.run("record whole", {}, [folder], lambda: record(folder, 3.0) and None)
    return project


def interrupted(project: Project, name: str, content: bytes | None = None, *, seconds: float = 3.0) -> Path:
    """A recording that a killed program has left; its file up to a share, or this content."""
    folder = project.folder / "recordings" / name
    (file,) = record(folder, seconds).glob("*.mcap")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(0.7 * len(whole))] if content is None else content)
    return file


def report_of(project: Project, name: str) -> dict:
    return json.loads((project.folder / f"{name}.synchronised.json").read_text())


def step_of(project: Project, step: str) -> dict:
    return json.loads((project.folder / "steps.json").read_text())[step]


def test_an_interrupted_recording_is_rescued_and_says_so(project: Project) -> None:
    interrupted(project, "torn")
    assert extract_recording(project, "torn")
    rescued = report_of(project, "torn")["rescued"]
    assert rescued == step_of(project, "extract torn")["rescued"]
    assert rescued["ends_early"]
    assert 1.9 < rescued["seconds"] < 2.3
    assert {one["topic"] for one in rescued["topics"]} == {
        "/ravenstate",
        "/arm2/measured_js",
        "/ext_jpos",
        "/joint_enc",
    }
    ((begin, end),) = rescued["gaps"]  # to the end of the chunk that was cut, as its head states it
    assert 0.3 < end - begin < 0.7
    lost = pytest.approx((end - begin) / begin, rel=0.1)
    assert all(one["kept"] > 50 and one["lost"] / one["kept"] == lost for one in rescued["topics"])
    (log,) = (read_log(motion_log_path(project, "torn")),)
    (note,) = [note for note in log.notes if note.startswith("rescued")]
    assert "nothing behind 2.1 s: its end is missing or damaged" in note
    assert not extract_recording(project, "torn")


def test_a_whole_recording_is_not_rescued(project: Project) -> None:
    extract_recording(project, "whole")
    assert report_of(project, "whole")["rescued"] is None
    assert "rescued" not in step_of(project, "extract whole")


@pytest.mark.parametrize("content", [b"", b"catenary journal 1\n"])
def test_a_recording_killed_at_its_begin_blocks_no_other(project: Project, content: bytes) -> None:
    interrupted(project, "begun", content)
    (project.folder / "recordings" / "empty").mkdir()
    interrupted(project, "torn")
    outcome = catenary("extract", project.folder, "--json")
    assert outcome.code == 0
    assert sorted(outcome.json) == ["torn", "whole"]
    assert "begun: was interrupted and is left out" in outcome.err
    assert "empty: was interrupted and is left out" in outcome.err
    assert outcome.json["torn"]["rescued"]["ends_early"]


def test_a_finished_recording_that_cannot_be_read_is_an_error_after_the_others(project: Project) -> None:
    (project.folder / "recordings" / "whole" / "0000.mcap").write_bytes(b"")
    interrupted(project, "torn")
    outcome = catenary("extract", project.folder)
    assert outcome.code == 2
    assert "whole" in outcome.err
    assert motion_log_path(project, "torn").is_file()


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_half_converted_bags_go_away_and_whole_ones_are_made_once(project: Project, kind: str) -> None:
    half = project.folder / "bags" / f"whole.{kind}.part"
    half.mkdir(parents=True)
    (half / "record_ravenstate.bag.part").write_bytes(b"#ROSBAG")
    written = write_bags(project, "whole", kind)
    assert [path.stem for path in written][:2] == ["record_CRTKmeasurejs", "record_about"]
    assert not half.exists()
    before = {path: path.stat().st_mtime_ns for path in (project.folder / "bags").rglob("*")}
    assert write_bags(project, "whole", kind) == written
    assert {path: path.stat().st_mtime_ns for path in (project.folder / "bags").rglob("*")} == before
    if kind == "ros1":
        assert BagStream(written[0]).damage == []
        written[0].write_bytes(b"torn")
        assert write_bags(project, "whole", "ros1") == written
        assert BagStream(written[0]).damage == []


def test_bags_of_somebody_else_are_left_alone(project: Project) -> None:
    folder = project.folder / "bags" / "whole"
    folder.mkdir(parents=True)
    (folder / "record_ravenstate.bag").write_bytes(b"mine")
    with pytest.raises(InputError, match="never overwritten; delete it"):
        write_bags(project, "whole", "ros1")
    assert (folder / "record_ravenstate.bag").read_bytes() == b"mine"
