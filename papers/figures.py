"""How the papers' pictures look: names and colours of controllers and methods, and empty axes as wide as a page."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# how controllers are called and drawn
LABELS = {"pd": "PD", "sg": "PD+SG", "dg": "PD+DG", "dg-imu": "PD+DG, IMU", "attitude": "PD+G of true attitude"}
COLORS = {
    "pd": "#1c2430",
    "sg": "#4b6b94",
    "dg": "#d9622b",
    "dg-imu": "#2f8f6b",
    "attitude": "#2f8f6b",
    "adaptive": "#c9a227",
    "adaptive-dg": "#8a5a9c",
    "recursive": "#b8bfc9",
    "recursive-dg": "#7a2f2f",
}
FOUR_COLORS = ("#1c2430", "#4b6b94", "#d9622b", "#2f8f6b")
METHOD_COLORS = {
    "raw": "#b8bfc9",
    "fixed offset": "#8a94a3",
    "linear": "#4b6b94",
    "polynomial": "#c9a227",
    "network": "#d9622b",
    "learner": "#2f8f6b",
}


def panels(columns: int, height: float, *, rows: int = 1, **options: Any) -> tuple["Figure", list[Any]]:
    """Return an empty matplotlib figure as wide as the page, and its axes row by row; the height is in inches."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(10, height), layout="constrained")
    return drawn, list(np.atleast_1d(drawn.subplots(rows, columns, **options)).ravel())


def legend_below(figure: "Figure", *panels: Any, columns: int | None = None) -> None:
    """Draw one legend of what panels show below all of them, each label once; all in one row without columns."""
    handles: dict[str, Any] = {}
    for panel in panels:
        handles |= dict(zip(*panel.get_legend_handles_labels()[::-1], strict=True))
    ncols = max(len(handles), 1) if columns is None else columns
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=ncols, frameon=False, fontsize=8)


def dots(panel: Any, ticks: Sequence[str], series: Mapping[str, Sequence[Any]], colors: Sequence[str]) -> None:
    """Draw the mean and each robot as dots by tick, of every series by its label; none of empty samples.

    The axis spans the values: bars from zero would all look equally high.
    """
    for k, ((label, values), color) in enumerate(zip(series.items(), colors, strict=True)):
        for i, each in enumerate(values):
            if len(each):
                place = i + 0.8 / len(series) * (k - 0.5 * (len(series) - 1))
                legend = label if i == 0 else None
                panel.plot(np.full(len(each), place), each, "o", color="white", markeredgecolor="#1c2430", ms=3)
                panel.plot(place, each.mean(), "o", color=color, ms=7, label=legend)
    panel.set_xticks(range(len(ticks)), ticks, fontsize=8)
    panel.margins(y=0.15)


def legend_above(figure: "Figure", panel: Any, *, columns: int) -> None:
    """Draw the legend of a panel above all of them."""
    handles = panel.get_legend_handles_labels()
    figure.legend(*handles, loc="outside upper center", ncols=columns, frameon=False, fontsize=9)


def log_scale(panel: Any) -> None:
    """Give a panel a logarithmic vertical axis, labelled with plain numbers at 1, 2 and 5 of every decade."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    panel.set_yscale("log")
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.yaxis.set_minor_formatter(NullFormatter())
