"""A row of the table of verdicts: an experiment, results made up for it, and what has to be said of them."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from papers.experiment import Outcomes


class Row(NamedTuple):
    """Results that are made up, and the verdicts on them."""

    experiment: str
    told: str  # what is made up
    outcomes: Callable[[], Outcomes]
    verdicts: str = (
        ""  # a letter of each claim: reproduced, same direction, not reproduced; a dot where it is not asked
    )
    shows: Sequence[str] = ()  # what tables, remarks and measured values must hold
    spread: str = ""  # as many letters: "y" where what is measured has a spread over robots
