"""Where a robot says that its tip is, against its file: the distance is named, and what makes it."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from catenary.dynamics.kinematics import forward_kinematics
from catenary.recording.import_formats import message_columns
from catenary.robots.catalog import load_robot
from catenary.spatial import Pose, quaternion_from_rotation, rotation_from_rpy
from catenary.workflows import import_recording as in_pieces
from catenary.workflows.import_recording import import_recording, import_to_file
from lab_bags import JOINT_STATE, POSE, Message, joint_state, pose, write_bag

PSM = load_robot("dvrk_psm")
ASIDE = Pose(rotation_from_rpy([0.0, 0.0, 0.3]), np.array([0.2, 0.1, 0.0]))
OFF = np.array([0.1, -0.2, 0.0, 0.3, 0.0, 0.0])
LONGER = Pose(np.eye(3), np.array([0.0, 0.0, 0.0508]))  # an S or Si instrument's


def lab(path: Path, tip: Callable[[np.ndarray], Pose], **others: Callable[[np.ndarray], Pose]) -> Path:
    """A PSM that reports its joints at 100 Hz and its tip at 40 Hz."""
    messages: list[Message] = []

    def q(t: float) -> np.ndarray:
        return np.array([0.5, 0.4, 0.03, 0.6, 0.5, 0.4]) * np.sin(t * np.linspace(1.0, 1.5, 6)) + [0, 0, 0.12, 0, 0, 0]

    for t in np.arange(0.0, 6.0, 0.01):
        messages.append((t, "/PSM1/measured_js", joint_state(PSM.joint_names, q(t))))
    for t in np.arange(0.0, 6.0, 0.025):
        for verb, of in {"measured_cp": tip, **{f"{k}/measured_cp": v for k, v in others.items()}}.items():
            at = of(q(t))
            messages.append((t, f"/PSM1/{verb}", pose(at.position, quaternion_from_rotation(at.rotation))))
    return write_bag(
        path, "ros1", {topic: JOINT_STATE if "js" in topic else POSE for _, topic, _ in messages}, messages
    )


def true(q: np.ndarray) -> Pose:
    return forward_kinematics(PSM, q)


SAID = {
    "as its file": (true, {}, ""),
    "another base frame, and its own beside": (lambda q: ASIDE @ true(q), {"local": true}, ""),
    "another tool": (lambda q: true(q) @ LONGER, {}, r"50\.8 mm and 0\.0 deg .* another tool"),
    "another base": (lambda q: ASIDE @ true(q), {}, r" mm and 17\.2 deg .* another base frame"),
    "joints of another zero": (lambda q: true(q + OFF), {}, "another robot, or other units"),
}


@pytest.mark.slow  # compiles the robot's kinematics
def test_a_tip_that_is_elsewhere_is_named_with_its_distance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mapping = {"robot": "dvrk_psm", "q_nominal": {"columns": "/PSM1/measured_js.position"}}
    for name, (tip, others, words) in SAID.items():
        bag = lab(tmp_path / name.replace(" ", "_"), tip, **others)  # type: ignore[arg-type]
        log = import_recording(bag, mapping)
        told = [note for note in log.notes if "from the tip of" in note]
        assert len(told) == bool(words), (name, log.notes)
        assert not words or re.search(words, told[0]), told
    monkeypatch.setattr(in_pieces, "MOST_NUMBERS", 13 * 100)
    monkeypatch.setattr(in_pieces, "OVERLAP", 20)
    monkeypatch.setattr(message_columns, "_BATCH", 50)
    done = import_to_file(tmp_path / "log.parquet", [tmp_path / "another_tool.bag"], mapping)
    assert len([note for note in done.notes if "from the tip of" in note]) == 1
