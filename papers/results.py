"""What an experiment leaves: tables printed on the way, a page and a data file with all that it takes to repeat it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary import __version__
from catenary.files import json_text
from catenary.reports.page import Block, Heading, Table, settings_facts, write_page


def shown(title: str, table: Table) -> list[Block]:
    """Print a table as Markdown; blocks of it for the page."""
    print(f"\n{title}\n\n| " + " | ".join(table.header) + " |\n|" + "---|" * len(table.header))
    for row in table.rows:
        print("| " + " | ".join(row) + " |", flush=True)
    return [Heading(title), table]


def spread(values: Sequence[float], digits: int = 1) -> str:
    """Mean and standard deviation of a sample, "-" of fewer than two."""
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
    """Write `name`.json and `name`.html of a simulated experiment.

    Args:
        folder: Made where it is missing.
        name: Of both files.
        title: Of the page.
        lead: What it shows, in a sentence.
        blocks: Of the page; its configuration follows them.
        configuration: What was set: seeds, angles, gains. Plain data.
        results: What came out. Plain data.

    Raises:
        FileFormatError: The page cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    content = {"simulated": True, "version": __version__, "configuration": configuration, "results": results}
    (folder / f"{name}.json").write_text(json_text(content), encoding="utf-8")
    write_page(
        folder / f"{name}.html",
        title,
        lead,
        [*blocks, Heading("Configuration"), settings_facts(configuration)],
        simulated=True,
    )
