import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

import simulated_arm
from catenary.recording.logs import read_log
from command_line import catenary, refusal


@pytest.mark.alike
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


def test_what_is_no_picture_is_not_replaced(tmp_path: Path) -> None:
    page = tmp_path / "other.png"
    page.write_text("mine")
    assert "is something else than a picture" in refusal("plot", "raven2", "--out", page)


def test_a_models_errors_on_a_recording_are_a_figure_of_a_column_with_fonts_in_it(tmp_path: Path) -> None:
    run, model = simulated_arm.write(tmp_path / "run.npz"), tmp_path / "arm.npz"
    assert catenary("fit", run, "--model", "linear", "--out", model).code == 0
    name = read_log(run).joint_names[1]
    out = tmp_path / "figure.pdf"
    shown = catenary("plot", model, run, "--joint", name, "--out", out, "--json").json
    assert shown == {"model": str(model), "joint": name, "out": str(out)}
    pdf = out.read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    width, _ = re.findall(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf)[0]
    assert float(width) == 3.5 * 72  # points
    assert "--joint x: expected one of" in refusal("plot", model, run, "--joint", "x", "--out", out)
    assert "do not go with LOG" in refusal("plot", model, run, "--payload", "1", "--out", out)
    assert "--joint: goes with LOG" in refusal("plot", "raven2", "--joint", "x", "--out", out)
