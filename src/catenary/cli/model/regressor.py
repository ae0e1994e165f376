"""catenary regressor."""

from typing import TYPE_CHECKING, Annotated

from typer import Option

from catenary.cli.robots import DescriptionOptions, Robot
from catenary.cli.terminal import print_fact, print_json, print_table
from catenary.errors import InputError

if TYPE_CHECKING:
    from catenary.arrays import Floats
    from catenary.workflows.regressor_report import RegressorReport


def regressor(
    robot: Robot,
    description: DescriptionOptions,
    compact: Annotated[bool, Option("--compact", help="Print the compact form, with its values.")] = False,
    latex: Annotated[bool, Option("--latex", help="Print the compact form for LaTeX.")] = False,
    as_json: Annotated[bool, Option("--json", help="Print JSON: kg and kg m.")] = False,
) -> None:
    """Print which masses gravity torques can identify.

    Example: catenary regressor planar_3r --compact
    """
    from catenary.workflows.regressor_report import describe_regressor

    if latex and as_json:
        raise InputError("regressor: give one of --latex and --json")
    report = describe_regressor(description.load(robot))
    if as_json:
        print_json(report.as_data())
    elif latex:
        print(report.compact.latex())
    elif compact:
        _print_compact(report)
    else:
        _print_identifiability(report)


def _print_compact(report: "RegressorReport") -> None:
    form = report.compact
    print(f"{report.model.name}: gravity on a level base, g_c = 9.81 m/s2\n\n{form}\n")
    values = _texts(report.compact_values, len(form.labels))
    columns = enumerate(zip(form.labels, values, form.units, strict=True), 1)
    rows = [[f"s{k}", *cells] for k, cells in columns]
    print_table("Parameters", ["", "", "value", "unit"], rows, left=2)
    symbols = [
        [name, symbol.meaning, "" if symbol.value is None else f"{symbol.value:.6g}"]
        for name, symbol in form.symbols.items()
    ]
    print_table("Symbols", ["", "", "value"], symbols, left=2)
    if form.ineffective:
        print_fact("without effect", ", ".join(form.ineffective), width=14)


def _print_identifiability(report: "RegressorReport") -> None:
    from catenary.gravity.regressor import standard_labels
    from catenary.workflows.regressor_report import WORDS

    names = standard_labels(report.model)
    values, kinds = _texts(report.standard_values, len(names)), map(report.identifiable, ("level", "tilted"))
    rows = [
        [name, WORDS[on_level], WORDS[on_tilted], value, "kg" if name.startswith("m(") else "kg m"]
        for name, value, on_level, on_tilted in zip(names, values, *kinds, strict=True)
    ]
    print_table(
        f"{report.model.name}: do gravity torques tell masses m, and moments m c in the links' frames?",
        ["parameter", "level base", "tilted base", "value", "unit"],
        rows,
        left=3,
    )
    of = str(len(names))
    rows = [[name, str(base.count), of, f"{base.condition:.3g}"] for name, base in report.bases.items()]
    print_table("What torques tell", ["base", "combinations", "of", "condition number"], rows)
    labels = report.combinations("level")
    columns = zip(labels, _texts(report.base_values("level"), len(labels)), strict=True)
    rows = [[f"b{k}", *cells] for k, cells in enumerate(columns, 1)]
    print_table("Combinations on a level base", ["", "", "value"], rows, left=2)
    for sentence in report.sentences():
        name, _, text = sentence.partition(": ")
        print_fact(f"{name}:", text, width=0) if text else print(f"  {sentence}")


def _texts(values: "Floats | None", count: int) -> list[str]:
    return ["-"] * count if values is None else [f"{value:.6g}" for value in values]
