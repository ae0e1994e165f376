"""What SIGTERM and SIGHUP do to a command of this process; the end-to-end tests send them to others."""

import ctypes
import os
import signal
import threading
from collections.abc import Iterator
from functools import partial

import pytest

from catenary.cli.exit_codes import EndedBySignal, signals_interrupt
from command_line import catenary

ENDS = [signal.SIGTERM, signal.SIGHUP]


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Signals that nobody took fail the test, and end no process of tests."""

    def refuse(number: int, _: object) -> None:
        raise AssertionError(f"{signal.Signals(number).name} was not taken")

    before = {number: signal.signal(number, refuse) for number in ENDS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", ENDS)
def test_a_signal_ends_a_command_with_its_own_code_and_a_line(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    cleaned: list[str] = []

    def interrupted() -> None:
        try:
            os.kill(os.getpid(), number)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # another one meanwhile changes nothing
            cleaned.append("up")

    monkeypatch.setattr("catenary.robots.catalog.robot_names", interrupted)
    before = signal.getsignal(number)
    outcome = catenary("robots")
    assert (outcome.code, outcome.err) == (128 + number, f"catenary: ended by {number.name}\n")
    assert cleaned == ["up"]
    assert signal.getsignal(number) is before


def test_a_motion_that_a_signal_ends_leaves_the_robot_holding_and_paused(monkeypatch: pytest.MonkeyPatch) -> None:
    from catenary.simulation.cable_plant import CablePlant

    wait = CablePlant.wait

    def signalled(plant: CablePlant) -> None:
        wait(plant)
        if plant.operating_state().is_homed and plant.control.setpoint[0] > 0.53:
            os.kill(os.getpid(), signal.SIGHUP)

    monkeypatch.setattr(CablePlant, "wait", signalled)
    outcome = catenary("goto", "--q-deg", "40", "--fast", "--json")
    assert outcome.code == 128 + signal.SIGHUP
    assert outcome.json["ended_by"] == "SIGHUP"
    assert outcome.json["interrupted"]
    assert outcome.json["state"]["state"] == "PAUSED"
    assert outcome.json["joints"][0]["q"] < 0.6


def test_a_signal_that_is_ignored_stays_ignored() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with signals_interrupt():
        os.kill(os.getpid(), signal.SIGHUP)
        with pytest.raises(EndedBySignal, match="SIGTERM"):
            os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_a_terminal_that_is_gone_hides_no_signal() -> None:
    def interrupted() -> None:
        with pytest.raises(EndedBySignal):
            os.kill(os.getpid(), signal.SIGHUP)
        raise OSError("Input/output error")

    with pytest.raises(EndedBySignal, match="SIGHUP"), signals_interrupt():
        interrupted()


def test_other_threads_change_no_handlers() -> None:
    found: list[object] = []

    def look() -> None:
        with signals_interrupt():
            found.append(signal.getsignal(signal.SIGTERM))

    before = signal.getsignal(signal.SIGTERM)
    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found == [before]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("number", [signal.SIGINT, *ENDS])
@pytest.mark.parametrize("where", ["callback of C", "__del__"])
def test_what_interrupts_where_python_ignores_it_interrupts_again(
    number: signal.Signals, where: str, request: pytest.FixtureRequest
) -> None:
    # a shell has what it runs in the background ignore Ctrl-C
    request.addfinalizer(partial(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT)))
    signal.signal(signal.SIGINT, signal.default_int_handler)

    class Ending:
        def __del__(self) -> None:
            signal.raise_signal(number)

    def interrupt() -> None:
        signal.raise_signal(number)

    with signals_interrupt():
        if where == "__del__":
            ending = Ending()
            del ending
        else:
            ctypes.CFUNCTYPE(None)(interrupt)()
        with pytest.raises(KeyboardInterrupt):
            threading.Event().wait(30.0)
