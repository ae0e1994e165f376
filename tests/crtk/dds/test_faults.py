"""Why a served robot is in FAULT, over DDS to who watches it."""

import threading

import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.topic_names import DialectName
from catenary.nodes.serve import ParkedArm, Serving, make_server, prepare
from catenary.simulation.cable_plant import JOINTS, UNITS
from catenary.workflows.robot.snapshots import watch_robot
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import robot_over
from patience import longer_limits

WHY = "the software e-stop tripped: a motor's command was too large"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_monitor_shows_why_a_robot_is_in_fault(
    dds_domain: int, dialect: DialectName, monkeypatch: pytest.MonkeyPatch
) -> None:
    for longer in longer_limits():  # a busy machine is late, and the robot not silent
        monkeypatch.setattr(*longer)
    plant, ended = homed_plant("left"), threading.Event()
    parked = ParkedArm(JOINTS, UNITS, plant.firmware.home_value)
    with DdsTransport("robot", settle=0.05) as carrier, DdsTransport("monitor", settle=0.05) as transport:
        plants = {"gold": plant, "green": parked}
        server = make_server(Serving(dialect=dialect), carrier, plants=plants)
        prepare(server)

        def serve() -> None:
            while not ended.wait(0.001):
                server.tick()

        serving = threading.Thread(target=serve)
        serving.start()
        try:
            watched, reader = robot_over(transport, dialect=dialect, only_read=True)
            with reader:
                samples = watch_robot(watched, every=0.0)
                assert next(samples).fault == ""
                plant._set_state("FAULT", WHY)
                told = next(sample for sample in samples if sample.fault)
        finally:
            ended.set()
            serving.join()
    assert f"the robot is in FAULT: {WHY}" in told.warnings()
