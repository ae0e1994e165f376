"""A gallery of recordings: one small made file in the shape of each real one that labs have on their disks.

Each module here holds SAMPLES, a list; the table in docs/formats-read.md is made of all of them by
`python -m tests.gallery`, and `tests/recording/import_formats/test_gallery.py` holds each against what is read of it.
"""

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

T = np.arange(600) / 100.0  # [s]
_PHASES = np.array([[0.3, 1.1], [2.0, 4.2], [5.1, 0.7]])
_RATES = np.array([[1.3, 3.1], [1.7, 2.3], [0.9, 2.9]])
_SIZES = np.array([[0.5, 0.1], [0.4, 0.15], [0.05, 0.02]])
_CENTRES = np.array([0.2, 1.1, 0.15])
_ANGLES = _RATES * T[:, None, None] + _PHASES
Q = _CENTRES + (_SIZES * np.sin(_ANGLES)).sum(axis=2)  # (600, 3) [rad, rad, m]
QD = (_SIZES * _RATES * np.cos(_ANGLES)).sum(axis=2)
TAU = np.column_stack([3.0 * np.sin(Q[:, 0]), 1.5 * np.cos(Q[:, 1]), 4.0 + 20.0 * QD[:, 2]])  # [Nm, Nm, N]
SEEN = 1.02 * Q + np.array([0.01, -0.02, 0.002])  # where the joints really were
CHOSEN = "rad,rad,m"
PAGE = Path(__file__).parents[2] / "docs" / "formats-read.md"
MARKS = ("<!-- what is read, made by python -m tests.gallery -->\n", "<!-- end of what is made -->\n")


@dataclass(frozen=True)
class Sample:
    """A recording in the shape of one that some program writes, and what is read of it."""

    source: str  # who writes such files, for the table
    file: str  # its name
    read: str  # what of it is read and told, for the table
    write: Callable[[Path], object]  # to a path
    says: Sequence[str] = ()  # in the proposal
    asks: Mapping[str, str] = field(default_factory=dict)  # what is open, and the answer
    units: str | None = CHOSEN
    robot: str | None = None
    refused: str = ""  # in the error, of what is not read
    truth: Mapping[str, np.ndarray] = field(default_factory=lambda: {"q_nominal": Q, "time": T})  # of the log, in SI
    within: float = 1e-6
    pose: str = ""  # of a tracker, by its first column, in place of joints


def samples() -> list[Sample]:
    """Return all."""
    modules = sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name != "__main__")
    found = [importlib.import_module(f"{__name__}.{name}").SAMPLES for name in modules]
    return [sample for some in found for sample in some]


def table() -> str:
    """Return the table of the page."""
    rows = []
    for one in samples():
        asks = ["q_encoder"] if one.pose else one.asks
        asked = f"refused: {one.refused}" if one.refused else ", ".join(f"`{about}`" for about in asks) or "nothing"
        rows.append(f"| {one.source} | `{one.file}` | {one.read} | {asked} |")
    return "\n".join(["| written by | file | read | asked |", "|---|---|---|---|", *rows]) + "\n"


def page() -> str:
    """Return the page with the table made anew."""
    before, _, rest = PAGE.read_text().partition(MARKS[0])
    return f"{before}{MARKS[0]}\n{table()}\n{MARKS[1]}{rest.partition(MARKS[1])[2]}"
