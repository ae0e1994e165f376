"""Tables for the terminal and for pages; self-contained HTML pages of text, tables and pictures."""

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from catenary import __version__
from catenary.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GREY, BLUE, ORANGE = "#b8c0cc", "#4b6b94", "#d9622b"  # of what is drawn: before, after, and what stands out
_DOTS_PER_INCH = 150
# a heading with its unit, and what of a record stands below: a function, or KEY:FORM as "rmse:.3f", ":.1f %" of a share
Column = str | tuple[str, str | Callable[[Any], Any]]


@dataclass(frozen=True)
class Table:
    """Records as rows, a column for what is told of each: its key or attribute; of lists the cell of its place.

    A heading alone is its own key. What is no number stands as it is, a dash for None and NaN.
    """

    columns: Sequence[Column]
    records: Sequence[Any]
    title: str = ""
    left: int = 1  # columns that stand to the left; the others to the right

    @property
    def header(self) -> list[str]:
        """The columns' headings."""
        return [column if isinstance(column, str) else column[0] for column in self.columns]

    @property
    def rows(self) -> list[list[str]]:
        """The cells, as text."""
        return [[_cell(column, record, place) for place, column in enumerate(self.columns)] for record in self.records]

    def text(self) -> str:
        """Return the table for a terminal, never cut; a unit in a heading, as in `J1 [deg]`, stands on its own line."""
        heads = [(*heading.replace(" [", "\n[").split("\n"), "")[:2] for heading in self.header]
        names = list(zip(*heads, strict=True)) if any(unit for _, unit in heads) else [[n for n, _ in heads]]
        cells = [[" ".join(cell.split()) for cell in row] for row in self.rows]
        widths = [max(len(row[i]) for row in [*names, *cells]) for i in range(len(heads))]
        lines = [self.title, ""] if self.title else []
        for row in (*names, ["-" * width for width in widths], *cells):
            placed = [
                cell.ljust(width) if i < self.left else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append(f"  {'  '.join(placed)}".rstrip())
        return "\n".join([*lines, ""])


def joint_columns(joints: Sequence[tuple[str, str]], value: Callable[[Any, int], Any], form: str) -> list[Column]:
    """Return a column for each joint of these names and units; `value` tells a record's number of the k-th."""

    def column(k: int, name: str, unit: str) -> Column:
        return f"{name} [{unit}]" if unit else name, lambda record: _text(value(record, k), form)

    return [column(k, *joint) for k, joint in enumerate(joints)]


def _cell(column: Column, record: Any, place: int) -> str:
    told = column if isinstance(column, str) else column[1]
    if callable(told):
        return _text(told(record), "")
    key, _, form = (column, "", "") if isinstance(column, str) else told.partition(":")
    if type(record) in (list, tuple):
        return _text(record[place], form)
    return _text(record[key] if isinstance(record, Mapping) else getattr(record, key), form)


def _text(value: Any, form: str) -> str:
    if value is None or value != value:  # NaN
        return "-"
    if isinstance(value, str):
        return value
    number = form.removesuffix(" %")
    return f"{value:{form}}" if number == form else f"{100.0 * value:{number}} %"


class Heading(NamedTuple):
    """Opens a section."""

    text: str


class Text(NamedTuple):
    """A paragraph."""

    text: str


class Facts(NamedTuple):
    """Names and what they stand for, in words that may be long."""

    rows: Sequence[tuple[str, str]]


class Remarks(NamedTuple):
    """Short paragraphs of equal weight."""

    texts: Sequence[str]


class Picture(NamedTuple):
    """An image, as base64 of a PNG."""

    png: str
    caption: str
    alt: str = ""  # what is seen, for who does not see it; the caption where empty


class Listing(NamedTuple):
    """Fixed-width text that opens on request."""

    summary: str
    text: str


Block = Heading | Text | Table | Facts | Remarks | Picture | Listing


def settings_facts(settings: Mapping[str, object]) -> Facts:
    """Return settings as people read them: lists without brackets, numbers without rounding digits, None left out."""
    rows = [(name.replace("_", " "), _told(value)) for name, value in settings.items() if value is not None]
    return Facts(rows)


def _told(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(_told(item) for item in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def picture(figure: "Figure", caption: str, alt: str = "") -> Picture:
    """Draw a matplotlib figure into a picture block, its axes open above and to the right."""
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=_DOTS_PER_INCH)
    return Picture(base64.b64encode(png.getvalue()).decode(), caption, alt)


def joint_panels(
    joints: Sequence[tuple[str, str]], height: float, columns: int = 1, *, spare: float = 0.0
) -> tuple["Figure", Any]:
    """Return a figure with a row of axes, `height` [inch], for each joint (name, unit), and its axes (n, columns)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, height * len(joints) + spare), layout="constrained")
    panels = figure.subplots(len(joints), columns, sharex=True, squeeze=False)
    for axes, (name, unit) in zip(panels[:, 0], joints, strict=True):
        axes.set_ylabel(f"{name} [{unit}]")
    return figure, panels


def write_picture(figure: "Figure", path: Path, endings: Sequence[str]) -> None:
    """Write a figure of the kind that the name ends in, else PNG; fonts are TrueType in PDF, outlines in SVG."""
    from matplotlib import rc_context

    kind = path.suffix.lower().removeprefix(".") if path.suffix.lower() in endings else "png"
    buffer = io.BytesIO()
    with rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format=kind, dpi=_DOTS_PER_INCH)
    write_atomically(path, buffer.getvalue())


def write_page(
    path: Path,
    title: str,
    lead: str,
    blocks: Sequence[Block],
    *,
    verdict: str = "",
    simulated: bool = False,
    made: date | None = None,
) -> None:
    """Write a page that needs no other file: title, verdict, lead, blocks; `made` today (UTC) when None."""
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=True)
    environment.filters["longest_word"] = lambda text: max(map(len, text.split()), default=0)
    template = environment.from_string((files("catenary.reports") / "page.html").read_text(encoding="utf-8"))
    sections = [(type(block).__name__, block) for block in blocks]  # the template asks for their kind
    html = template.render(
        title=title,
        lead=lead,
        verdict=verdict,
        sections=sections,
        footer=f"catenary {__version__}",
        simulated=simulated,
        made=(made or datetime.now(UTC).date()).isoformat(),
    )
    # a file's name may hold bytes that are no text
    write_atomically(path, html.encode("utf-8", "backslashreplace"))
