"""Blocks of the recordings that are fitted, held out in turn: what a choice of the model is judged by."""

from collections.abc import Sequence

import numpy as np

from catenary.identification.samples import Samples

FOLDS = 5
TURNS = 2  # blocks of each recording in every fold


def fold_of_rows(samples: Samples, folds: int = FOLDS) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Return which fold each row is in (N,): blocks of time, one fold after the other, and once more around."""
    block = np.arange(len(samples)) * (folds * TURNS) // max(len(samples), 1)
    return np.asarray(block % folds, dtype=np.int64)


def folds_of(samples: Sequence[Samples], folds: int = FOLDS) -> list[list[Samples]]:
    """Return the recordings' rows by fold; a fold may lack a recording that is too short."""
    out: list[list[Samples]] = []
    for f in range(folds):
        parts = [part.rows(fold_of_rows(part, folds) == f, part.name) for part in samples]
        out.append([part for part in parts if len(part)])
    return out
