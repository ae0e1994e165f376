import json
import re
import webbrowser
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import simulated_arm
from catenary.calibration.model_file import load_model
from catenary.dynamics.kinematics import forward_kinematics
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from catenary.view import page_process, simulated
from command_line import catenary, refusal


def test_a_port_of_the_system_is_refused() -> None:
    assert "--port: expected 1024 to 65535, got 80" in refusal("view", "raven2", "--port", "80")


def test_view_without_viser_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_process, "find_spec", lambda name: None)
    assert re.search(r"not installed: pip install .*'viser>=", refusal("view", "raven2"))


@pytest.mark.slow
def test_view_says_where_its_page_is_and_ends_after_the_time_that_it_was_given() -> None:
    outcome = catenary("view", "two_link", "--seconds", 3, "--port", 18090, "--json")
    assert outcome.code == 0
    told = json.loads(outcome.out)
    assert told["shown"] == "two_link"
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{22}/", told["url"])


@pytest.mark.usefixtures("no_page")
def test_ctrl_c_is_the_usual_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulated.DrivenArm, "run", interrupted)
    assert catenary("view", "two_link", "--port", 18091).code == 0


@pytest.mark.parametrize(
    ("option", "screen", "expected"),
    [(["--open"], "", True), (["--no-open"], ":0", False), ([], ":0", False), ([], "", False)],
)
def test_browser_is_opened_where_it_is_asked_for_and_not_from_a_pipe(
    option: list[str], screen: str, expected: bool, no_page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(simulated.DrivenArm, "run", lambda *_: None)
    monkeypatch.setenv("DISPLAY", screen)
    assert catenary("view", "two_link", "--port", 18092, *option).code == 0
    assert opened == [no_page] * expected


def log() -> MotionLog:
    """A recording of three joints that also holds the torque of a fourth."""
    content = simulated_arm.arrays()
    pull = np.sin(np.arange(400) / 20.0)
    return MotionLog(
        "train", ("J1", "J2", "J3"), ("rad", "rad", "m"), content["q_des"], content["ok"],
        q_encoder=content["q_act"] + 0.01 * pull[:, None], time=content["t"],
        signals={"tau:roll": pull}, signal_units={"tau:roll": "Nm"},
    )  # fmt: skip


def test_a_recording_is_played_as_lines_of_json(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz")
    outcome = catenary("monitor", "--log", path, "--json", "--speed", "1000", "--rate", "200")
    assert outcome.code == 0, outcome
    lines = [json.loads(line) for line in outcome.out.splitlines()]
    assert lines[-1]["time"] > 13.0  # the recording is 13.3 s long
    assert lines[-1]["gravity"] is None  # nobody tells


def test_a_simulated_robot_is_watched_in_plain_lines() -> None:
    outcome = catenary("monitor", "--seconds", "0.1", "--rate", "20")
    assert outcome.code == 0, outcome
    assert "ENABLED, homed" in outcome.out
    assert "shoulder=30" in outcome.out or "shoulder=29" in outcome.out
    assert "tip error" in outcome.out


def test_a_simulation_shows_the_true_error_of_joints_and_tip() -> None:
    outcome = catenary("monitor", "--seconds", "0.1", "--rate", "20", "--json")
    shot = json.loads(outcome.out.splitlines()[-1])
    model, reported = load_robot("raven2"), np.array(shot["q"][:3])
    true = reported - shot["true_error"]
    # cables and their friction: some degrees and millimetres, and less than an encoder's zero, 7.5 deg at the elbow
    assert 0.001 < np.abs(shot["true_error"]).max() < 0.1
    apart = [forward_kinematics(model, q).position for q in (reported, true, np.array(shot["q_encoder"][:3]))]
    assert_allclose(shot["tip"], apart[0])
    assert_allclose(shot["tip_error"], np.linalg.norm(apart[0] - apart[1]))
    assert_allclose(shot["tip_from_encoders"], np.linalg.norm(apart[0] - apart[2]))


def test_a_model_that_takes_more_than_joints_is_played_beside_its_recording(tmp_path: Path) -> None:
    train = log()
    path = tmp_path / "train.parquet"
    write_parquet(train, path)
    assert catenary("fit", path, "--model", "linear", "--inputs", "q,tau:roll", "--out", tmp_path / "m.npz").code == 0
    model, _ = load_model(tmp_path / "m.npz")
    outcome = catenary(
        "monitor", "--log", path, "--model", tmp_path / "m.npz", "--json", "--speed", "1e4", "--rate", "200"
    )
    assert outcome.code == 0, outcome
    last = json.loads(outcome.out.splitlines()[-1])
    assert_array_equal(last["q_calibrated"], model.calibrate(train)[-1])


def test_a_bare_recording_is_read_with_the_units_of_the_model_or_those_given(tmp_path: Path) -> None:
    path = simulated_arm.write(tmp_path / "run.npz")
    assert catenary("fit", path, "--model", "linear", "--out", tmp_path / "m.npz").code == 0
    bare = simulated_arm.write(tmp_path / "bare.npz", units=None)
    line = ("monitor", "--log", bare, "--json", "--speed", "1e4", "--rate", "200")
    assert catenary(*line, "--model", tmp_path / "m.npz").code == 0
    told = catenary(*line, "--units", "rad,m,m").out.splitlines()
    assert json.loads(told[-1])["units"] == ["rad", "m", "m"]
    assert "--units: goes with --log" in refusal("monitor", "--units", "rad,rad,m")
