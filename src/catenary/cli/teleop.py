"""catenary teleop: a robot moved from the keyboard of any terminal."""

import time
from typing import Annotated

from typer import Option

from catenary.cli.options import Record
from catenary.cli.robot_choice import MovedRobot, open_robot, recorded
from catenary.cli.terminal import announce, print_json, print_notes


def teleop(
    robot: MovedRobot,
    not_homed: Annotated[
        bool, Option("--not-homed", help="Simulated: begin with a robot that was just switched on.")
    ] = False,
    record: Record = None,
    as_json: Annotated[bool, Option("--json", help="Print JSON at the end.")] = False,
) -> None:
    """Move a robot from the keyboard.

    Joint by joint or along the axes, in any terminal and over SSH. Hold a key to move: all motion ends a
    quarter of a second after its last repeat. ? lists the keys. On every way out the robot holds, then is
    paused.
    """
    from catenary.teleop.session import TeleopSession
    from catenary.teleop.terminal import RawTerminal

    terminal = RawTerminal()
    announce("preparing the robot ...")
    with open_robot(robot, "teleop", homed=not not_homed) as opened:
        with recorded(opened, record) as observe, terminal:
            session = TeleopSession(opened.plant, opened.model, opened.name, terminal, observe=observe)
            why = session.run(time.monotonic)
        state, q = opened.plant.operating_state(), opened.plant.measured_js().q
    if as_json:
        ended = {"robot": opened.name, "ended_by": why, "state": state._asdict()}
        print_json({**ended, "q": q, "late_ticks": opened.late()})
    else:
        print_notes([session.message] if "not paused" in session.message else [])
        print(f"{opened.name}: ended by {why}; the robot is {state.state}")
