"""Tables, for a terminal, pages, notebooks and LaTeX, and what an object shows of itself in a notebook."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any, NamedTuple

# a heading with its unit, and what of a record stands below: a function, or KEY:FORM as "rmse:.3f", ":.1f %" of a share
Column = str | tuple[str, str | Callable[[Any], Any]]
_MAX_SHOWN_ROWS = 20  # in a notebook
_MAX_TITLE, _MAX_FORMULA = 120, 4000  # characters
_TEX = str.maketrans(
    {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
    | {"±": r"$\pm$", "<": "$<$", ">": "$>$", **{c: f"\\{c}" for c in "&%$#_{}"}}
)
_NEGATIVE = re.compile(r"-(?=[0-9.])")


@dataclass(frozen=True)
class Table:
    """Records as rows, a column for each reported key or attribute; of lists the cell of its place.

    A heading alone is its own key. What is no number stands as it is, a dash for None and NaN.
    """

    columns: Sequence[Column]
    records: Sequence[Any]
    title: str = ""
    left_aligned: int = 1  # number of first columns aligned to the left; the others to the right

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
                cell.ljust(width) if i < self.left_aligned else cell.rjust(width)
                for i, (cell, width) in enumerate(zip(row, widths, strict=True))
            ]
            lines.append(f"  {'  '.join(placed)}".rstrip())
        return "\n".join([*lines, ""])

    def html(self) -> str:
        """Return the table for a notebook, of its first rows where there are many."""
        left_out = len(self.records) - _MAX_SHOWN_ROWS
        more = f"<p>and {left_out} more rows</p>" if left_out > 0 else ""
        shown = [(self.header, "th"), *((row, "td") for row in self.rows[:_MAX_SHOWN_ROWS])]
        cells = ["".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) for row, tag in shown]
        title = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        return f"<table>{title}{''.join(f'<tr>{row}</tr>' for row in cells)}</table>{more}"

    def latex(self) -> str:
        """Return the table for LaTeX with the package booktabs."""
        rows = [f"{' & '.join(map(_tex, row))} \\\\" for row in (self.header, *self.rows)]
        sides = "l" * self.left_aligned + "r" * (len(self.columns) - self.left_aligned)
        lines = [f"\\begin{{tabular}}{{{sides}}}", r"\toprule", rows[0], r"\midrule", *rows[1:], r"\bottomrule"]
        return "\n".join([*lines, r"\end{tabular}"])


def joint_columns(joints: Sequence[tuple[str, str]], value: Callable[[Any, int], Any], form: str) -> list[Column]:
    """Return a table's column for each joint.

    Args:
        joints: Name and unit of each joint.
        value, form: Function from a record and k to the k-th joint's number, and its format: ".2f".
    """

    def column(k: int, name: str, unit: str) -> Column:
        return f"{name} [{unit}]" if unit else name, lambda record: _text(value(record, k), form)

    return [column(k, *joint) for k, joint in enumerate(joints)]


def _cell(column: Column, record: Any, place: int) -> str:
    content = column if isinstance(column, str) else column[1]
    if callable(content):
        return _text(content(record), "")
    key, _, form = (column, "", "") if isinstance(column, str) else content.partition(":")
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


def _tex(cell: str) -> str:
    return _NEGATIVE.sub("$-$", cell.translate(_TEX))


def in_units(units: Iterable[str]) -> str:
    """Return the units of a column: [deg], [mm], or [deg|mm] where each row names its own."""
    return f"[{'|'.join(sorted(set(units)))}]"


class Screen(NamedTuple):
    """Contents of an object's screen: title, tables, verdict."""

    title: str  # a line
    tables: Sequence[Table] = ()
    verdict: str = ""
    formula: Callable[[], str] | None = None  # as LaTeX, lines of a display


class OnScreen:
    """An object that shows itself: by `repr` in a line, in a notebook as a screen, and for LaTeX."""

    @property
    def screen(self) -> Screen:
        """What it shows."""
        raise NotImplementedError

    def __repr__(self) -> str:
        title = " ".join(self.screen.title.split())
        return f"<{type(self).__name__} {title if len(title) <= _MAX_TITLE else f'{title[:_MAX_TITLE]}...'}>"

    def _repr_html_(self) -> str:
        screen = self.screen
        parts = [f"<p><b>{type(self).__name__}</b> {escape(screen.title)}</p>", *(t.html() for t in screen.tables)]
        if screen.formula is not None:
            text = r" \\ ".join(screen.formula().splitlines())
            is_short = len(text) <= _MAX_FORMULA
            parts.append(f"<div>$$\\begin{{gathered}} {escape(text)} \\end{{gathered}}$$</div>" if is_short else "")
        return "".join([*parts, f"<p>{escape(screen.verdict)}</p>" if screen.verdict else ""])

    def to_latex(self) -> str:
        """Return its tables for LaTeX with the package booktabs, or its formula."""
        screen = self.screen
        formula = [] if screen.formula is None else [screen.formula()]
        return "\n\n".join([*formula, *(table.latex() for table in screen.tables)])
