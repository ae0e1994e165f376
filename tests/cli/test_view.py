import json
import re
import webbrowser

import pytest

from catenary.view import page_process, simulated
from command_line import catenary, refusal


class NoPage:
    """In the place of the page's process, which takes seconds to start."""

    url = "http://127.0.0.1:18092/0123456789abcdefghijkl/"

    def __init__(self, **_: object) -> None: ...

    def __enter__(self) -> "NoPage":
        return self

    def __exit__(self, *_: object) -> None: ...

    def open(self, shown: object) -> str:
        return self.url


@pytest.fixture
def _no_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_process, "PageProcess", NoPage)


@pytest.mark.usefixtures("_no_page")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ravn2"], 'did you mean "raven2"?'),
        (["raven2", "--model", "none.npz"], "none.npz"),
        (["panda", "--robot-seed", "1"], "a seed draws the cables"),
        (["dvrk_psm"], "no inertia"),
        (["raven2", "--ros", "1", "--log", "x.npz"], "--log: does not go with --ros"),
        (["raven2", "--dialect", "crtk"], "--dialect: goes with --ros"),
        (["raven2", "--gravity", "/gravity"], "--gravity: goes with --ros"),
        (["raven2", "--log", "none.parquet"], "none.parquet"),
        (["raven2", "--log", "x.npz", "--robot-seed", "1"], "--log: does not go with --robot-seed"),
    ],
)
def test_view_refuses_what_cannot_be_shown(arguments: list[str], message: str) -> None:
    assert message in refusal("view", *arguments)


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


@pytest.mark.usefixtures("_no_page")
def test_ctrl_c_is_the_usual_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulated.DrivenArm, "run", interrupted)
    assert catenary("view", "two_link", "--port", 18091).code == 0


@pytest.mark.usefixtures("_no_page")
@pytest.mark.parametrize(
    ("option", "screen", "expected"),
    [(["--open"], "", True), (["--no-open"], ":0", False), ([], ":0", False), ([], "", False)],
)
def test_browser_is_opened_where_it_is_asked_for_and_not_from_a_pipe(
    option: list[str], screen: str, expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(simulated.DrivenArm, "run", lambda *_: None)
    monkeypatch.setenv("DISPLAY", screen)
    assert catenary("view", "two_link", "--port", 18092, *option).code == 0
    assert opened == [NoPage.url] * expected
