"""Schematic figures: what they name exists, and every text lies in its box."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from numpy.testing import assert_allclose

import simulated_arm
from catenary.calibration.calibration import fit
from catenary.cli.main import GROUPS
from catenary.raven2.topics import JOINTS
from catenary.raven2.transmission import COUPLING
from catenary.recording.logs import read_log
from catenary.reports.schematic import SCHEMATICS, model_schematic
from command_line import catenary, refusal


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


@pytest.mark.parametrize("name", SCHEMATICS)
def test_texts_lie_in_their_boxes_and_boxes_apart(name: str) -> None:
    boxes_hold_their_texts(SCHEMATICS[name]())


def boxes_hold_their_texts(figure: Figure) -> None:
    figure.canvas.draw()
    (axes,) = figure.axes
    boxes = [patch.get_window_extent() for patch in axes.patches if isinstance(patch, FancyBboxPatch)]
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k])
    written = [text.get_window_extent() for text in axes.texts if text.get_text()]
    for box in boxes:
        middle = 0.5 * (box.min + box.max)
        inside = min(written, key=lambda text: float(np.linalg.norm(0.5 * (text.min + text.max) - middle)))
        assert (inside.min >= box.min).all(), inside
        assert (inside.max <= box.max).all(), inside


def test_commands_are_those_of_the_program_and_cables_those_of_the_robot() -> None:
    commands = [text.split()[1] for text in texts(SCHEMATICS["commands"]()) if text.startswith("catenary ")]
    assert {"teleop", "goto", "random", "follow", "record", "monitor", "view"} <= set(commands)
    assert set(commands) <= {name for group in GROUPS.values() for name in group}
    cables = texts(SCHEMATICS["cables"]())
    assert [f"{j} {joint}" for j, joint in enumerate(JOINTS, 1)] == [text for text in cables if text[2:] in JOINTS]
    shown = [float(text.split()[0]) for text in cables if text.endswith("/rad")]
    assert_allclose(shown, COUPLING * [1.0, 1e3, 1e3], rtol=1e-2)


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("linear", "A x + b\n6 signals"),
        ("learned", " terms"),
        ("neural", "network\n6-100-100-3"),
        ("offset", "A x + b"),
    ],
)
def test_a_model_is_drawn_with_what_it_takes(kind: str, told: str, tmp_path: Path) -> None:
    log = simulated_arm.write(tmp_path / "run.npz", tau=np.zeros((400, 3)))
    figure = model_schematic(fit([read_log(log)], model=kind))
    assert any(told in text for text in texts(figure))
    boxes_hold_their_texts(figure)


def test_the_command_draws_them_and_refuses_what_they_do_not_go_with(tmp_path: Path) -> None:
    out = tmp_path / "cables.svg"
    shown = catenary("plot", "raven2", "--schematic", "cables", "--out", out, "--json").json
    assert shown == {"robot": "raven2", "schematic": "cables", "out": str(out)}
    assert b"80,000 counts a turn" in out.read_bytes()
    assert "expected one of raven2, raven2_right" in refusal("plot", "panda", "--schematic", "cables", "--out", out)
    assert "do not go with --schematic" in refusal(
        "plot", "raven2", "--schematic", "cables", "--payload", "1", "--out", out
    )
    assert "--schematic" in refusal("plot", "raven2", "--schematic", "wires", "--out", out)
    assert "nosuch" in refusal("plot", "nosuch", "--schematic", "commands", "--out", out)
