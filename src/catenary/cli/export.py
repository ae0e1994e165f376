"""catenary export."""

from pathlib import Path
from typing import Annotated

import typer

from catenary.cli.robots import Robot
from catenary.cli.terminal import print_fact, print_json, print_notes


def export(
    robot: Robot,
    c: Annotated[Path, typer.Option("--c", metavar="OUT", help="C header to write, e.g. arm.h.")],
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="CALIBRATION", help="Calibration model to export with it."),
    ] = None,
    rate_hz: Annotated[
        float,
        typer.Option("--rate-hz", metavar="HZ", help="Of the loop that the calibration model will run in."),
    ] = 1000.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Write a robot as one C header.

    Gravity torque, its regressor, joint correction, for control loops in C and C++: no library, no memory.

    Example: catenary export raven2 --c raven2.h
    """
    from catenary.calibration.files import load_model
    from catenary.jobs.export import c_header, write_header
    from catenary.robots.catalog import load_robot

    calibration = None if model is None else load_model(model)[0]
    header = c_header(load_robot(robot), calibration, rate_hz=rate_hz)
    write_header(header, c)
    print_notes(header.notes)
    if as_json:
        print_json({"file": str(c), "functions": header.functions})
        return
    print_fact("written", str(c), width=9)
    print_fact("functions", ", ".join(header.functions), width=9)
