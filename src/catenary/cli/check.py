"""catenary check."""

from typing import Annotated

import typer

from catenary.cli.terminal import print_json


def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A robot, a calibration model or a recording.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what a file is and what is wrong with it; exit code 1 when something is.

    Robots are catalogue names, .toml, .urdf, .xml and .mjcf files; models are .npz; recordings .npz or .parquet.
    """
    from catenary.jobs.check import check_file

    finding = check_file(file)
    if as_json:
        print_json(finding.as_data())
    else:
        print(f"{file}: {finding.kind}")
        width = max(len(name) for name, _ in finding.facts)
        for name, text in finding.facts:
            print(f"  {name:<{width}}  {text}")
        for remark in finding.remarks:
            print(f"  remark: {remark}")
        for fault in finding.faults:
            print(f"  WRONG:  {fault}")
        print("  nothing wrong found" if not finding.faults else f"  {len(finding.faults)} fault(s) found")
    if finding.faults:
        raise typer.Exit(1)
