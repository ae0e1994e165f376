"""Rows that are in the training and in the test: errors on them say nothing."""

from collections.abc import Collection, Sequence

import numpy as np

from catenary.plant import MotionLog
from catenary.verdict.finding import Finding, judge

MOST = 0.01  # share of a test's rows that may be in the training; poses that rest repeat themselves


def require_apart(
    train: Sequence[MotionLog], test: Sequence[MotionLog], accept: Collection[str] = ()
) -> list[str]:
    """Refuse tests of which rows were trained on, to the last bit, whatever their file is called.

    Args:
        train: Recordings to fit.
        test: Recordings to judge by.
        accept: Names of findings to go on with.

    Returns:
        Notes on those that were accepted.
    """
    found = []
    for log in test:
        own = _rows(log)
        for other in train:
            same = sum(row in own for row in set(_rows(other)))
            if own and same > MOST * len(own):
                says = f'{same} of its {len(own)} measured rows are in "{other.name}", which is trained on'
                culprit = "one recording copied, cut or renamed"
                found.append((log.name, Finding("tested", (), says, culprit)))
    return judge(found, accept)


def _rows(log: MotionLog) -> set[bytes]:
    """Return commands and measurements of the trusted rows as bytes."""
    if log.q_encoder is None:
        return set()
    return {row.tobytes() for row in np.hstack([log.q_nominal, log.q_encoder])[log.ok]}
