"""Why a robot is in FAULT reaches who watches it, and who wants to move it."""

import pytest

from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback
from catenary.crtk.names import DIAGNOSTICS, DIAGNOSTICS_TYPE
from catenary.crtk.reader import CrtkReader
from catenary.errors import NotReadyError
from served_robot import ServedRobot, shoulder

WHY = "the software e-stop tripped: a motor's command was too large"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_fault_is_told_with_its_reason(dialect):
    robot = ServedRobot(dialect)
    heard, told = robot.client.subscribe(DIAGNOSTICS, DIAGNOSTICS_TYPE), robot.hear("warning")
    robot.tick(5)
    (ok,) = heard.take()[-1].message.status
    assert (ok.level, ok.message, ok.hardware_id) == (0, "ENABLED", "/arm1")
    robot.plant._set_state("FAULT", WHY)
    robot.tick(5)
    (fault,) = heard.take()[-1].message.status
    assert (fault.level, fault.message) == (2, f"FAULT: {WHY}")
    assert f"gold: FAULT: {WHY}" in [one.message.data for one in told.take()]
    before = len(heard.take())
    robot.tick(500)
    assert len(heard.take()) == before == 0  # once a second
    robot.tick(600)
    assert len(heard.take()) == 1


def test_who_wants_to_move_it_is_told():
    robot = ServedRobot("crtk")
    sleep = robot.clock.sleep

    def ticking(seconds):
        for _ in range(max(1, round(seconds * 1000))):
            sleep(0.001)
            robot.server.tick()

    robot.clock.sleep = ticking
    client = CrtkClient(Loopback("mine", robot.network), dialect="crtk")
    assert client.fault_reason == ""
    robot.plant._set_state("FAULT", WHY)
    client.wait()
    with pytest.raises(NotReadyError, match=rf"the robot is FAULT \({WHY}\), expected ENABLED"):
        client.servo_jr(shoulder(1e-3))
    assert CrtkReader(Loopback("other", robot.network), dialect="crtk").fault_reason == WHY
    client.state_command("disable")
    assert client.fault_reason == ""
    client.state_command("enable")
