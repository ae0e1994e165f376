"""catenary export."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from catenary.cli.terminal import print_fact, print_json, print_notes


def export(
    what: Annotated[
        str,
        Argument(metavar="WHAT", help="With --c a robot, as fk takes it; with --onnx a calibration model."),
    ],
    c: Annotated[Path | None, Option(metavar="OUT", help="C header of a robot to write, e.g. arm.h.")] = None,
    onnx: Annotated[Path | None, Option(metavar="OUT", help="ONNX graph to write, e.g. arm.onnx.")] = None,
    model: Annotated[Path | None, Option(metavar="CALIBRATION", help="Calibration for the C header.")] = None,
    rate_hz: Annotated[
        float | None,
        Option(
            metavar="HZ",
            help="Rate of the loop that the model will run in. [default: 1000 in C, the training rows' in ONNX]",
        ),
    ] = None,
    as_json: Annotated[bool, Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Write a robot as C, or a model as an ONNX graph.

    The header holds gravity torque, its regressor and joint correction, for loops in C and C++: no library, no
    memory. The graph computes in float64; what the model remembers goes in and out as tensors.

    Example: catenary export raven2 --c raven2.h
    """
    from catenary.errors import InputError

    if (c is None) == (onnx is None):
        raise InputError("export: expected one of --c OUT for a robot, --onnx OUT for a calibration model")
    if c is not None:
        _c(what, c, model, 1000.0 if rate_hz is None else rate_hz, as_json)
    elif onnx is not None:
        if model is not None:
            raise InputError(f"export: --onnx writes WHAT, {what}, which is the model; leave --model out")
        _onnx(Path(what), onnx, rate_hz, as_json)


def _c(robot: str, out: Path, model: Path | None, rate_hz: float, as_json: bool) -> None:
    from catenary.calibration.files import load_model
    from catenary.robots.catalog import load_robot
    from catenary.workflows.c_header import c_header, write_header

    calibration = None if model is None else load_model(model)[0]
    header = c_header(load_robot(robot), calibration, rate_hz=rate_hz)
    write_header(header, out)
    print_notes(header.notes)
    if as_json:
        print_json({"file": str(out), "functions": header.functions})
        return
    print_fact("written", str(out), width=9)
    print_fact("functions", ", ".join(header.functions), width=9)


def _onnx(model: Path, out: Path, rate_hz: float | None, as_json: bool) -> None:
    from catenary.workflows.onnx_file import export_onnx

    summary = export_onnx(model, out, rate_hz=rate_hz)
    if as_json:
        print_json(summary)
        return
    print_notes(summary["notes"])
    for name in ("file", "kind", "inputs", "outputs", "signals", "joints"):
        value = summary[name]
        if isinstance(value, dict):
            value = [f"{tensor} ({', '.join(map(str, shape))})" for tensor, shape in value.items()]
        print_fact(name, value if isinstance(value, str) else ", ".join(value), width=7)
