"""Self-contained HTML reports: headings, text, tables, plots; figures as files."""

import base64
import io
from collections.abc import Mapping, Sequence
from datetime import UTC, date, datetime
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from catenary import __version__
from catenary.files import write_atomically
from catenary.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# colours of lines: before, after, highlighted; they print as light, dark and medium grey
GREY, BLUE, ORANGE = "#b8c0cc", "#2c4a75", "#d9622b"
_DOTS_PER_INCH = 150
_POINTS_OF_A_MARKER = 4  # points of a line that take as many bytes in SVG
_MAX_DRAWN_POINTS = 1000  # of a line or an area; longer ones are rasterised in vector files


class Heading(NamedTuple):
    """Title of a section."""

    text: str


class Text(NamedTuple):
    """A paragraph."""

    text: str


class Facts(NamedTuple):
    """List of names and descriptions."""

    rows: Sequence[tuple[str, str]]


class Remarks(NamedTuple):
    """Short paragraphs of equal weight."""

    texts: Sequence[str]


class Picture(NamedTuple):
    """A PNG image in base64."""

    png: str
    caption: str
    alt: str = ""  # alternative text; the caption if empty


class Listing(NamedTuple):
    """Fixed-width text that opens on request."""

    summary: str
    text: str


Block = Heading | Text | Table | Facts | Remarks | Picture | Listing


def settings_facts(settings: Mapping[str, object]) -> Facts:
    """Return settings as readable text: lists without brackets, six significant digits, without those that are None."""
    rows = [(name.replace("_", " "), _text(value)) for name, value in settings.items() if value is not None]
    return Facts(rows)


def _text(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(item) for item in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def picture(figure: "Figure", caption: str, alt: str = "") -> Picture:
    """Render a matplotlib figure as a picture block, without top and right spines.

    Args:
        alt: Alternative text; the caption if empty.
    """
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=_DOTS_PER_INCH)
    return Picture(base64.b64encode(png.getvalue()).decode(), caption, alt)


def joint_panels(
    joints: Sequence[tuple[str, str]], height: float, columns: int = 1, *, spare: float = 0.0
) -> tuple["Figure", Any]:
    """Return a figure with a row of axes, `height` [inch], for each joint (name, unit), and the axes (n, columns)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, height * len(joints) + spare), layout="constrained")
    panels = figure.subplots(len(joints), columns, sharex=True, squeeze=False)
    for axes, (name, unit) in zip(panels[:, 0], joints, strict=True):
        axes.set_ylabel(f"{name} [{unit}]")
    return figure, panels


def write_picture(figure: "Figure", path: Path, endings: Sequence[str]) -> None:
    """Write a figure in the format of the file's suffix; fonts are TrueType in PDF, outlines in SVG.

    Lines of many points are rasterised, so that a figure of hours takes some 100 kB.

    Args:
        endings: Suffixes of known formats, such as ".pdf"; others give PNG.
    """
    from matplotlib import rc_context

    for axes in figure.axes:
        for line in axes.lines:
            each = 1 if line.get_marker() == "None" else _POINTS_OF_A_MARKER
            line.set_rasterized(each * len(line.get_path()) > _MAX_DRAWN_POINTS)
        for area in axes.collections:
            area.set_rasterized(sum(map(len, area.get_paths())) > _MAX_DRAWN_POINTS)
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
    """Write a self-contained page: title, verdict, lead, blocks; `made` is today (UTC) when None."""
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
    # file names may contain undecodable bytes
    write_atomically(path, html.encode("utf-8", "backslashreplace"))
