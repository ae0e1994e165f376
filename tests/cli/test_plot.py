import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from command_line import catenary, refusal


@pytest.mark.parametrize(
    ("ending", "begins"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), ("", b"\x89PNG")]
)
def test_pictures_have_the_kind_that_their_names_say(tmp_path: Path, ending: str, begins: bytes) -> None:
    out = tmp_path / f"arm{ending}"
    content = catenary(
        "plot", "two_link", "--q-deg", "30,60", "--base-tilt-deg", "0,20", "--hide", "torques", "--out", out, "--json"
    ).json
    assert out.read_bytes().startswith(begins)
    assert content["out"] == str(out)
    assert_allclose(content["gravity"], [3.3552, 0.0, -9.2184], atol=1e-4)  # 9.81 sin and cos of 20 deg
    if ending == ".svg":
        assert ET.parse(out).getroot().tag.endswith("svg")
        again = catenary("plot", "two_link", "--hide", "torques", "--out", out)
        assert again.out == f"picture: {out}\n"  # one of its own kind is replaced


def test_a_robot_without_masses_is_drawn_without_torques_and_that_is_said(tmp_path: Path) -> None:
    outcome = catenary("plot", "dvrk_psm_motors", "--out", tmp_path / "psm.png")
    assert outcome.code == 0
    assert "no torques: the description gives no mass of yaw, pitch" in outcome.err


def test_a_joint_beyond_its_limits_and_gravity_upwards_are_noted(tmp_path: Path) -> None:
    err = catenary("plot", "raven2", "--q", "0,1.57,9", "--gravity", "0,0,9.81", "--out", tmp_path / "a.png").err
    assert "insertion: 9 m is outside its limits" in err
    assert "points up" in err


def test_what_cannot_be_drawn_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    assert "no window can be opened here; give --out" in refusal("plot", "raven2")
    assert "--json: goes with --out" in refusal("plot", "raven2", "--json")
    assert 'ending ".npz": expected .png or .svg or .pdf' in refusal("plot", "raven2", "--out", tmp_path / "a.npz")
    assert "hide: x: expected some of" in refusal("plot", "raven2", "--hide", "x", "--out", tmp_path / "a.png")
    assert "slides without limits" in refusal("plot", "dvrk_psm_motors", "--workspace", "--out", tmp_path / "a.png")
    assert "does not go with" in refusal("plot", "raven2", "--gravity", "0,0,-9", "--base-tilt-deg", "0,1")
    page = tmp_path / "other.png"
    page.write_text("mine")
    assert "is something else than a picture" in refusal("plot", "raven2", "--out", page)
