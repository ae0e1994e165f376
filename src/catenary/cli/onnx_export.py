"""catenary export, of a calibration model."""

from pathlib import Path
from typing import Annotated

import typer

from catenary.cli.terminal import print_fact, print_json, print_notes


def export(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="A model that catenary fit wrote.")],
    onnx: Annotated[Path, typer.Option("--onnx", metavar="OUT", help="ONNX file to write, e.g. arm.onnx.")],
    rate_hz: Annotated[
        float | None,
        typer.Option(
            "--rate-hz",
            metavar="HZ",
            help="Of the loop that the graph will run in. [default: of the training rows]",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")] = False,
) -> None:
    """Write a calibration model as an ONNX graph.

    It computes in float64; what the model remembers goes in and out as tensors.

    Example: catenary export arm.npz --onnx arm.onnx
    """
    from catenary.jobs.export_onnx import export_onnx

    summary = export_onnx(model, onnx, rate_hz=rate_hz)
    if as_json:
        print_json(summary)
        return
    print_notes(summary["notes"])
    for name in ("file", "kind", "inputs", "outputs", "signals", "joints"):
        value = summary[name]
        if isinstance(value, dict):
            value = [f"{tensor} ({', '.join(map(str, shape))})" for tensor, shape in value.items()]
        print_fact(name, value if isinstance(value, str) else ", ".join(value), width=7)
