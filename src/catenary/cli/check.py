"""catenary check."""

from typing import Annotated

import typer
from typer import Argument

from catenary.cli.options import AsJson, Units
from catenary.cli.terminal import print_fact, print_json, words


def check(
    file: Annotated[str, Argument(metavar="FILE", help="A robot, a calibration model or a recording.")],
    units: Units = None,
    as_json: AsJson = False,
) -> None:
    """Say what a file is and what is wrong with it.

    The exit code is 1 when something is wrong. Robots are catalogue names, .toml, .urdf, .xml and .mjcf files;
    models are .npz; recordings .npz, .parquet or RAVEN-II's published .csv.
    """
    from catenary.workflows.check import check_file

    finding = check_file(file, units=None if units is None else words(units))
    if as_json:
        print_json(finding.as_data())
    else:
        print(f"{file}: {finding.kind}")
        width = max(len("remark:"), *(len(name) for name, _ in finding.facts))
        for name, text in finding.facts:
            print_fact(name, text, width=width)
        for remark in finding.remarks:
            print_fact("remark:", remark, width=width)
        for fault in finding.faults:
            print_fact("WRONG:", fault, width=width)
        print(f"  {len(finding.faults)} fault(s) found" if finding.faults else "  nothing wrong found")
    if finding.faults:
        raise typer.Exit(1)
