"""catenary drift: whether a model still holds, and since when it does not."""

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from catenary.cli.fit import Recordings
from catenary.cli.options import Accept, AsJsonNotTables, MappingOptions, MendOptions
from catenary.cli.terminal import print_json, print_notes, print_table


def drift(
    model: Annotated[Path, Argument(metavar="MODEL", help="A model that catenary fit or refresh wrote.")],
    data: Recordings,
    mending: MendOptions,
    foreign: MappingOptions,
    factor: Annotated[
        float,
        Option(metavar="K", help="For a model without intervals: times its card's error that is too much."),
    ] = 2.0,
    accept: Accept = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Print a model's error over days and homings.

    Recordings come in the order of time. The exit code is 1 where a joint is beyond at the end, or where something is
    wrong with a recording, which is no drift.

    Example: catenary drift arm.npz monday.parquet tuesday.parquet
    """
    from catenary.units import DISPLAY
    from catenary.workflows.drift import drift_of_model, drift_summary, since_in_words

    found, notes = drift_of_model(
        model, data, reading=mending.reading(foreign), accept=tuple(accept or ()), factor=factor
    )
    if as_json:
        print_json(drift_summary(found, notes))
    else:
        print_notes(notes)
        names = [f"{n} [{DISPLAY[u][0]}]" for n, u in zip(found.joint_names, found.joint_units, strict=True)]
        rows = [
            [s.recording, str(s.homing), s.date or "-", str(s.rows)]
            + [f"{e:.3f}{' !' if bad else ''}" for e, bad in zip(s.rmse, s.beyond, strict=True)]
            for s in found.stretches
        ]
        header = ["recording", "homing", "date", "rows", *names]
        print_table("RMSE between homings; ! beyond", header, rows)
        print(f"beyond: {found.judged_by}")
        print("\n".join(since_in_words(found)) or "the model holds on the last of them")
    if any(first is not None for first in found.since):
        raise typer.Exit(1)
