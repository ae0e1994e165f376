"""What an experiment leaves: tables printed on the way, pictures, a page and a data file with what it was run with."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary import __version__
from catenary.files import json_text
from catenary.reports.page import Block, Heading, Table, settings_facts, write_page


def shown(title: str, table: Table) -> list[Block]:
    """Print a table as Markdown; return it with its heading as blocks of the page."""
    print(f"\n{title}\n\n| " + " | ".join(table.header) + " |\n|" + "---|" * len(table.header))
    for row in table.rows:
        print("| " + " | ".join(row) + " |", flush=True)
    return [Heading(title), table]


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Return mean and standard deviation of a sample, "-" for fewer than two values."""
    if len(values) < 2:
        return "-"
    return f"{np.mean(values):.{digits}f} ± {np.std(values, ddof=1):.{digits}f}"


def write_results(
    folder: Path,
    name: str,
    title: str,
    lead: str,
    blocks: Sequence[Block],
    *,
    configuration: Mapping[str, Any],
    results: Any,
) -> None:
    """Write `name`.json and `name`.html of a simulated experiment, its configuration (plain data) in both.

    For the other arguments and errors see `write_files`.
    """
    whole = [*blocks, Heading("Configuration"), settings_facts(configuration)]
    write_files(folder, name, title, lead, whole, {"configuration": configuration, "results": results})


def write_files(
    folder: Path, name: str, title: str, lead: str, blocks: Sequence[Block], content: Mapping[str, Any]
) -> None:
    """Write `name`.json and `name`.html of a simulated experiment.

    Args:
        folder: Created if it is missing.
        name: Of both files.
        title: Of the page.
        lead: What the page shows, in a sentence.
        blocks: Of the page.
        content: Of the data file, beside the package's version: what was set and what came out, as plain data.

    Raises:
        FileFormatError: The page cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    data = {"simulated": True, "version": __version__, **content}
    (folder / f"{name}.json").write_text(json_text(data), encoding="utf-8")
    write_page(folder / f"{name}.html", title, lead, list(blocks), simulated=True)
