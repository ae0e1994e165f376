"""catenary drift: whether a model still holds, and since when it does not."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from catenary.cli.fit import MaxError, Recordings, limits
from catenary.cli.options import Accept, AsJsonNotTables, MappingOptions, ModelMendOptions
from catenary.cli.out_files import PAGE, Report, refuse_outputs
from catenary.cli.terminal import print_json, print_notes, print_table


def drift(
    model: Annotated[Path, Argument(metavar="MODEL", help="A model that catenary fit or refresh wrote.")],
    data: Recordings,
    mending: ModelMendOptions,
    foreign: MappingOptions,
    factor: Annotated[
        float,
        Option(metavar="K", help="For a model without intervals: times its card's error that is too much."),
    ] = 2.0,
    max_error: MaxError = None,
    accept: Accept = None,
    report: Report = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Print a model's error over days and homings.

    Recordings come in the order of time. The exit code is 1 where a joint is beyond at the end, or where something is
    wrong with a recording, which is no drift.

    Example: catenary drift arm.npz monday.parquet tuesday.parquet --report drift.html
    """
    from catenary.calibration.model_drift import since_in_words
    from catenary.reports.drift import drift_table, write_drift_report
    from catenary.workflows.calibration_model import drift_of_model, drift_summary

    refuse_outputs({"--report": (report, PAGE)}, [model, *data])
    found, notes = drift_of_model(
        model,
        data,
        reading=mending.reading(foreign),
        accept=tuple(accept or ()),
        factor=factor,
        max_error=limits(max_error),
    )
    if as_json:
        print_json(drift_summary(found, notes))
    else:
        print_notes(notes)
        table = drift_table(found)
        print_table("RMSE between homings; ! beyond", table.header, table.rows)
        print(f"beyond: {found.judged_by}")
        print("\n".join(since_in_words(found)) or "the model holds on the last of them")
    if report is not None:
        write_drift_report(report, found, model=model.name, notes=notes)
        if not as_json:
            print(f"page: {report}")
    if any(first is not None for first in found.since):
        raise typer.Exit(1)
