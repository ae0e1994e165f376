import json

import pytest

from catenary.nodes import serve
from command_line import catenary
from oracles.manual_time import ManualTime


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ticks take no time, and time passes between them only."""
    monkeypatch.setattr(serve, "time", ManualTime())


def test_serving_prints_a_line_a_second_and_sums_up():
    result = catenary("serve", "--ros", "none", "--homed", "--duration", "1.5", "--json")
    assert result.code == 0, result.err
    lines = [json.loads(line) for line in result.out.splitlines()]
    assert [line["final"] for line in lines] == [False, True]
    assert lines[-1]["states"] == {"gold": "PAUSED homed", "green": "parked"}
    assert lines[-1]["rate_hz"] == pytest.approx(1000.0, rel=1e-3)
    assert lines[-1]["lost_ticks"] == 0


def test_a_person_reads_state_and_rate():
    result = catenary(
        "serve", "--ros", "none", "--homed", "--dialect", "crtk", "--duration", "1.2", "--rate", "200"
    )
    assert "gold DISABLED homed" in result.out
    assert "to nobody" in result.err


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (("--dialect", "klingon"), "raven or crtk"),
        (("--ros", "3"), "1, 2 or none"),
        (("--robot", "toaster"), "raven2"),
        (("--base-tilt-deg", "1"), "roll and pitch"),
        (("--rate", "700"), "divided by a whole number"),
        (("--payload", "-1"), "payload"),
    ],
)
def test_bad_options_are_told(options, word):
    result = catenary("serve", "--ros", "none", "--duration", "0.1", *options)
    assert result.code == 2
    assert word in result.err


def test_a_button_that_nobody_offers_is_told():
    result = catenary("button", "--ros", "none")
    assert result.code == 2
    assert "nobody offers it" in result.err
