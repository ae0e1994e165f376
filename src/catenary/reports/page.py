"""Self-contained HTML pages: text, tables and pictures in one file that opens anywhere."""

import base64
import io
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from catenary import __version__
from catenary.files import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150


class Heading(NamedTuple):
    """Opens a section."""

    text: str


class Text(NamedTuple):
    """A paragraph."""

    text: str


class Table(NamedTuple):
    """Cells already written as text; the first column names the row."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


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
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH)
    return Picture(base64.b64encode(buffer.getvalue()).decode(), caption, alt)


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
    """Write a page that needs no other file and no network; its footer names the version of catenary.

    Args:
        path: The HTML file.
        title: Its heading.
        lead: What was looked at, below the verdict.
        blocks: The rest.
        verdict: What came out, in one sentence.
        simulated: Mark the page as one of no real robot.
        made: The page's date; today (UTC) when None.
    """
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
