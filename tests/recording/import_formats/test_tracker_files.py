"""Trackers' files beyond the gallery: stamps of transforms, exports and poses that are none."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.recording.import_formats.mapping import TrackedPose
from catenary.recording.import_formats.sources import Sources
from catenary.recording.import_formats.tracked_pose import pose_places
from catenary.workflows.import_recording import import_recording
from gallery.trackers import ROWS, P, R, motive, table, transforms, write
from lab_bags import KINDS, Kind

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
