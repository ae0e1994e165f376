import re
import signal
import termios

import pytest

from typist import Typist


def shoulder_deg(shown: bytes) -> float:
    """Where the joint was when it was drawn last; a picture that has come in part may lack it still."""
    drawn = re.findall(rb"shoulder +([0-9.]+) deg", shown)
    return float(drawn[-1]) if drawn else 0.0


@pytest.mark.slow
def test_the_real_command_moves_a_simulated_robot_and_leaves_the_terminal_as_it_was() -> None:
    with Typist() as typist:
        typist.wait_for(b"catenary teleop")
        typist.hold(b"q", lambda: shoulder_deg(typist.seen) > 30.8)
        typist.type(b"Q")
        end = typist.end()
        assert end["state"]["state"] == "PAUSED"
        assert end["q"][0] > 0.53  # homed at 30 deg, 0.5236 rad
        assert termios.tcgetattr(typist.slave) == typist.before


@pytest.mark.slow
def test_a_signal_pauses_the_robot_and_restores_the_terminal() -> None:
    with Typist() as typist:
        typist.wait_for(b"catenary teleop")
        typist.process.send_signal(signal.SIGTERM)
        end = typist.end()
        assert end["ended_by"] == "SIGTERM"
        assert end["state"]["state"] == "PAUSED"
        assert termios.tcgetattr(typist.slave) == typist.before
