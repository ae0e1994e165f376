"""The table of docs/calibration.md: every model kind on recordings of a da Vinci PSM (Hwang et al., RA-L 2020).

Trained on the first 80 % of each recording, tested on the rest. Run it with `make dvrk-table`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from catenary.calibration.evaluate import Evaluation, JointErrors
from catenary.calibration.fit import PLAY_SHARES, FitOptions
from catenary.errors import FileFormatError
from catenary.workflows.fit import FitRun, fit_calibration
from papers.arguments import make_parser

FOLDER = "dvrk_calibration_berkeley"
# camera failures of sampled_train, as the recordings' README bounds them (deg, deg, mm, deg, deg, deg)
SAMPLED_LIMIT = (2.0, 2.0, 5.0, 60.0, 60.0, 70.0)
RECORDINGS: dict[str, tuple[float, ...] | None] = {
    "random_train": None,
    "insertion_train": None,
    "peg_transfer_train": None,
    "sampled_train": SAMPLED_LIMIT,
}
HISTORY = 6
KINDS = {
    "linear": FitOptions(kind="linear"),
    "polynomial": FitOptions(kind="polynomial"),
    "neural, paper": FitOptions(kind="neural", preset="paper"),
}


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    model: str
    rmse: tuple[float, ...]
    outside: float


def models() -> Iterator[tuple[str, FitOptions]]:
    """Yield every kind of model without memory, with previous commands, and with play states."""
    for name, options in KINDS.items():
        yield name, options
        yield f"{name}, history {HISTORY}", replace(options, history=HISTORY)
        yield f"{name}, play", replace(options, play=PLAY_SHARES)
    best = FitOptions(kind="neural", preset="best")
    yield "neural, best", best
    yield f"neural, best, history {HISTORY}", replace(best, history=HISTORY)


def rows(path: Path, limit: tuple[float, ...] | None) -> Iterator[Row]:
    """Fit and test every model on one recording."""
    run = FitRun(held_out=0.2, folds=0, max_error=limit)
    offset = fit_calibration([path], FitOptions(kind="offset"), run)
    first = _held_out(offset.held_out)
    yield Row("raw", tuple(j.raw_rmse for j in first), 0.0)
    yield Row("fixed offset", tuple(j.offset_rmse for j in first), 0.0)
    for name, options in models():
        joints = _held_out(fit_calibration([path], options, run).held_out)
        yield Row(name, tuple(j.rmse for j in joints), joints[0].outside_valid_range)


def _held_out(evaluation: Evaluation | None) -> tuple[JointErrors, ...]:
    return () if evaluation is None else evaluation.joints


def main(data: Path) -> None:
    """Print the table in Markdown.

    Raises:
        FileFormatError: The recordings are not there.
    """
    folder = data / FOLDER
    if not folder.is_dir():
        raise FileFormatError(f"{folder}: no such folder; give the folder that holds {FOLDER}")
    for name, limit in RECORDINGS.items():
        print(f"\n### `{name}`\n")
        print("| model | J1 deg | J2 deg | J3 mm | J4 deg | J5 deg | J6 deg | outside range |")
        print("|---|---|---|---|---|---|---|---|")
        for row in rows(folder / f"{name}.npz", limit):
            cells = " | ".join(f"{v:.3f}" for v in row.rmse)
            print(f"| {row.model} | {cells} | {100.0 * row.outside:.1f} % |", flush=True)


if __name__ == "__main__":
    parser = make_parser(__doc__)
    parser.add_argument("data", type=Path, help=f"the folder that holds {FOLDER}")
    main(parser.parse_args().data)
