"""Message types that only the bag defines, and definitions that nobody should believe."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rosbags.rosbag1 import Writer

from catenary.errors import FileFormatError
from catenary.recording.import_formats.recording_files import Sources
from catenary.workflows.import_recording import import_recording
from lab_bags import KINDS, START, Kind, Message, true_q, two_topics, write_bag

ARM = "std_msgs/Header header\nlab_msgs/Joint[] joints\nfloat64[3] camera\nstring mode\nuint8 OFF=0\nbool ok\n"
JOINT = "string name\nfloat32 pos  # [deg]\nfloat64[2] limits\n"


def own_types(path: Path, kind: Kind) -> Path:
    """A bag of lab_msgs/Arm, 100 Hz: positions in degrees in an array of messages."""
    messages: list[Message] = []
    for i, t in enumerate(np.arange(0.0, 3.0, 0.01)):

        def make(store: Any, head: Any, i: int = i, t: float = t) -> Any:
            arm, joint = (store.types[f"lab_msgs/msg/{name}"] for name in ("Arm", "Joint"))
            shown = [np.float32(np.rad2deg(q)) for q in true_q(t)]
            joints = [joint("j" * (1 + i % 3), q, np.zeros(2)) for q in shown]
            return arm(head, joints, true_q(t) + 0.01, "run" * (i % 2), i != 7)

        messages.append((t, "/lab/arm", make))
    types = {"lab_msgs/msg/Joint": JOINT, "lab_msgs/msg/Arm": ARM}
    return write_bag(path, kind, {"/lab/arm": "lab_msgs/msg/Arm"}, messages, types=types)


@pytest.mark.parametrize("kind", KINDS)
def test_types_are_read_by_the_definitions_in_the_bag(kind: Kind, tmp_path: Path) -> None:
    bag = own_types(tmp_path / "lab", kind)
    options = [f"q_nominal={','.join(f'/lab/arm.joints[{i}].pos' for i in range(3))}@deg,deg,mm"]
    log = import_recording(bag, [*options, "q_encoder=/lab/arm.camera@rad,rad,m", "ok=/lab/arm.ok"])
    scale = np.array([1.0, 1.0, np.rad2deg(1.0) / 1000.0])
    assert_allclose(log.q_nominal, true_q(log.time) * scale, atol=1e-5)  # float32 of degrees
    assert_allclose(log.q_encoder, true_q(log.time) + 0.01)
    assert np.flatnonzero(~log.ok).tolist() == [7]


def with_definition(path: Path, name: str, definition: str, data: bytes) -> Path:
    with Writer(path) as writer:
        connection = writer.add_connection("/odd", name, msgdef=definition, md5sum="0" * 32)
        for i in range(3):
            writer.write(connection, START + i, data)
    return path


LINE = "=" * 80
DOUBLING = "".join(f"{LINE}\nMSG: lab_msgs/T{i}\nT{i + 1} a\nT{i + 1} b\n" for i in range(1, 25))


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        (f"Loop a\n{LINE}\nMSG: lab_msgs/Loop\nLoop a\n", "holds itself"),
        ("lab_msgs/Gone a\n", "is not defined"),
        ("wstring a\n", "wstring"),
        ("float64[ a\n", "cannot be read"),
        ("float64 a\n" * 20_000, "characters"),
        (f"T1 a\nT1 b\n{DOUBLING}{LINE}\nMSG: lab_msgs/T25\nuint8 X=1\n", "messages within one"),
        ("uint8[] data\n", "claims|ends before|bytes"),
    ],
)
def test_definitions_that_no_message_has_are_refused_and_harm_no_other_topic(
    definition: str, message: str, tmp_path: Path
) -> None:
    bag = with_definition(tmp_path / "odd.bag", "lab_msgs/msg/Odd", definition, b"\xff\xff\xff\x7f" * 4)
    with pytest.raises(FileFormatError, match=message):
        Sources([bag])
    whole = two_topics(tmp_path / "lab", "ros1", seconds=3.0)
    beside = Sources([bag, whole])
    log_streams = {stream.name for stream in beside.streams if stream.columns}
    assert log_streams == {"/raven/joint_cmd", "/optitrack/joints"}
