"""Files in the shape of those that labs have are read right at the first try; the page's table says what is read."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import gallery
from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.column_groups import by_motion
from catenary.recording.import_formats.mapping import TrackedPose
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.import_formats.tracked_pose import pose_places, positions_and_rotations
from catenary.workflows.import_recording import import_recording, propose_mapping
from gallery import trackers

SAMPLES = gallery.samples()


@pytest.mark.alike
@pytest.mark.parametrize("sample", SAMPLES, ids=[sample.file for sample in SAMPLES])
def test_a_file_of_the_field_is_read_at_the_first_try(sample: gallery.Sample, tmp_path: Path) -> None:
    path = tmp_path / sample.file
    sample.write(path)
    if sample.refused:
        with pytest.raises((FileFormatError, InputError), match=sample.refused):
            import_recording(path, accept_proposal=True, units=sample.units, robot=sample.robot)
        return
    if sample.pose:
        _is_pose(path, sample)
        return
    proposal = propose_mapping(path, units=sample.units, robot=sample.robot)
    asked = [question.rpartition("--answer ")[2].partition("=")[0] for question in proposal.questions]
    assert asked == list(sample.asks), proposal.toml
    log = import_recording(
        path, accept_proposal=True, units=sample.units, robot=sample.robot, answers=dict(sample.asks)
    )
    answered = propose_mapping(path, units=sample.units, robot=sample.robot, answers=dict(sample.asks)).toml
    for words in sample.says:
        assert words in answered
    for quantity, expected in sample.truth.items():
        found = getattr(log, quantity)
        assert found is not None, (quantity, answered)
        assert_allclose(found, expected, atol=sample.within, err_msg=quantity)


def _is_pose(path: Path, sample: gallery.Sample) -> None:
    """A pose is asked for; as proposed it is read in metres, and a row on which the tracker saw nothing is no zero."""
    proposal = propose_mapping(path, robot="two_link")
    assert any("tells where the joints were" in question for question in proposal.questions)
    proposal = propose_mapping(path, robot="two_link", answers={"q_encoder": sample.pose})
    sources, tracked = Sources([path]), TrackedPose(**tomllib.loads(proposal.toml)["q_encoder"]["pose"])
    places = pose_places(tracked, sources.streams)
    stream = sources.read({places[0].stream: [place.column for place in places]})[places[0].stream]
    values = np.column_stack([stream.columns[place.column] for place in places])
    position, rotation = positions_and_rotations(tracked, values)
    rows = np.arange(trackers.ROWS)
    if "tf_" in sample.file:  # where it has any message there, and all of them were seen
        rows = rows[(rows % 5 > 0) | (rows % 3 > 0)]
    seen = ~np.isin(rows, trackers.LOST) | ("tf_" in sample.file)
    assert np.isnan(position[~seen]).all()
    assert_allclose(position[seen], trackers.P[rows[seen]], atol=1e-8)  # nine digits in the file
    assert_allclose(rotation[seen], trackers.R.as_matrix()[rows[seen]], atol=1e-7)
    for words in sample.says:
        assert words in proposal.toml
    taken = [line for line in proposal.toml.splitlines() if "columns" in line]
    assert not any("local/measured_cp" in line or "PSM1/measured_cp" in line for line in taken)


REAL = Path(os.environ.get("CATENARY_DATA", gallery.PAGE.parents[2] / "shared" / "data"))
ARMS = (
    "dvrk_wpi_dynamics/mtm_one", "dvrk_wpi_dynamics/psm_one", "panda_dynamics/panda_first60",
    "tiago_dynamics/tiago_dynamic", "ur10e_dynamics/free_12harm_30s",
)  # fmt: skip


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no recordings in {REAL}; set CATENARY_DATA")
@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("order", ["q dq third", "third q dq", "q third dq"])
@pytest.mark.parametrize("timed", [True, False])
def test_velocities_and_torques_of_real_arms_are_told_without_names(arm: str, order: str, timed: bool) -> None:
    content = np.load(REAL / f"{arm}.npz")
    third = next(content[name] for name in ("tau", "current", "effort") if name in content)
    blocks = {"q": content["q"], "dq": content["dq"], "third": third}
    n = third.shape[1]
    columns = {f"data[{i}]": v for i, v in enumerate(np.column_stack([blocks[b] for b in order.split()]).T)}
    seconds = np.arange(len(third)) / float(content["fs"]) if "fs" in content else content["t"]
    found = by_motion(columns, seconds if timed else None)
    for block, told in (("q", found.q), ("dq", found.qd), ("third", found.tau)):
        first = n * order.split().index(block)
        assert told == tuple(f"data[{first + j}]" for j in range(n))
    assert not found.again


def test_the_page_says_what_the_gallery_holds() -> None:
    assert gallery.PAGE.read_text() == gallery.page(), "run python -m tests.gallery"
