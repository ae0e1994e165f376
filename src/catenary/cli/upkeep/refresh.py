"""catenary refresh: a model brought up to date."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from catenary.cli.fit import MaxError, Recordings, limits
from catenary.cli.options import Accept, AsJsonNotTables, MappingOptions, ModelMendOptions
from catenary.cli.out_files import MODEL, NAMED_AS_TYPED, out_path, refuse_outputs
from catenary.cli.terminal import print_json, print_notes, print_table
from catenary.files import card_path


def refresh(
    model: Annotated[Path, Argument(metavar="MODEL", help="A model that catenary fit wrote.")],
    data: Recordings,
    mending: ModelMendOptions,
    foreign: MappingOptions,
    out: Annotated[
        Path, Option(metavar="MODEL", parser=out_path, help=f"Refreshed model to write. {NAMED_AS_TYPED}")
    ],
    max_error: MaxError = None,
    accept: Accept = None,
    as_json: AsJsonNotTables = False,
) -> None:
    """Bring a model up to date with minutes of a new day.

    Each joint gets what blocks of time of the new data show to pay, the least that does: nothing, a new zero, zero
    and scale, or a new last layer. The card says from which model it comes, what moved, and since when.

    Example: catenary refresh arm.npz today.parquet --out arm_today.npz
    """
    from catenary.calibration.model_file import save_model
    from catenary.workflows.calibration_model import refresh_calibration

    outputs = {"--out": (out, MODEL), "the card of --out": (card_path(out), None)}
    refuse_outputs(outputs, [model, *data])
    result = refresh_calibration(
        model,
        data,
        reading=mending.reading(foreign),
        accept=tuple(accept or ()),
        max_error=limits(max_error),
    )
    save_model(result.model, result.card, out)
    shown = result.as_data()
    if as_json:
        print_json({"model": str(out), "card": str(card_path(out)), **shown})
        return
    print_notes(result.notes)
    rows = [
        [
            j["name"],
            j["unit"],
            j["change"],
            f"{j['moved']:+.3f}",
            f"{j['rmse_before']:.3f}",
            f"{j['rmse_after']:.3f}",
        ]
        for j in shown["joints"]
    ]
    header = ["joint", "unit", "change", "moved", "RMSE before", "on blocks after"]
    print_table(f"What became of each joint, on {shown['rows']:,} new rows", header, rows)
    print(f"moved: {result.moved}\nmodel: {out}\ncard:  {card_path(out)}")
