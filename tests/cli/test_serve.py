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


def test_a_signal_pauses_the_arms_and_the_last_lines_say_so(monkeypatch):
    from catenary.cli.signals import EndedBySignal

    heard = []

    def show(status):
        heard.append(status)
        raise EndedBySignal("SIGTERM")

    monkeypatch.setattr("catenary.cli.nodes._show", show)
    result = catenary("serve", "--ros", "none", "--homed", "--start", "--duration", "60")
    assert heard
    assert "ended by SIGTERM: gold PAUSED homed, green parked" in result.err


def test_a_person_reads_state_and_rate():
    options = ("--dialect", "crtk", "--duration", "1.2", "--rate", "200")
    result = catenary("serve", "--ros", "none", "--homed", *options)
    assert "gold DISABLED homed" in result.out
    assert "to nobody" in result.err
