import json
import re
import webbrowser

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.robots.catalog import load_robot
from catenary.view import page_process, simulated_arm
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

    monkeypatch.setattr(simulated_arm.DrivenArm, "run", interrupted)
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
    monkeypatch.setattr(simulated_arm.DrivenArm, "run", lambda *_: None)
    monkeypatch.setenv("DISPLAY", screen)
    assert catenary("view", "two_link", "--port", 18092, *option).code == 0
    assert opened == [no_page] * expected


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
