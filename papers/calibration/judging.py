"""How the calibration paper's claims are decided on errors of several robots: what is less, and what decides a claim.

An error is less than another where it is so by more than `MARGIN` in the mean over robots and by more than the spread
over robots of their ratio: the same robot has both errors. The paper calls a gain of 20 % considerable (figure 6); the
smallest that it calls better is 5 %, 0.167 against 0.176 mm (table II). Margin and spread were added after a first run,
in which differences of the third digit had counted, and so was that a claim's own statement decides, not what stands
beside it.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from scipy import stats

from catenary.arrays import Floats
from papers.experiment import MARGIN, Judgement
from papers.kit import JOINTS, as_text, by_robot, graded, mean_and_spread

CONSIDERABLE = 0.2  # of the larger error: what the paper calls considerably better
_SURE = 0.95  # probability from which one session tells
BY_ONE_SESSION = (
    f"under our robots one session shows it with a probability of {100.0 * _SURE:.0f} % or more; not reproduced: of "
    f"{100.0 * (1.0 - _SURE):.0f} % or less; between these the paper's one session cannot tell"
)


def less(smaller: Floats, larger: Floats, margin: float = MARGIN) -> Any:
    """Say where positive numbers by robot, (robots, ...), are less than others; a truth for each but the first axis."""
    with np.errstate(divide="ignore", invalid="ignore"):  # nothing is less than nothing
        gained = np.log(np.asarray(larger) / np.asarray(smaller))
    return _beyond_spread(gained, -np.log(1.0 - margin))


def less_lost(smaller: Floats, larger: Floats) -> Any:
    """Say the same of losses (robots, ...), which may be negative: by the spread of differences, and `MARGIN`."""
    gained = np.asarray(larger) - np.asarray(smaller)
    return _beyond_spread(gained, MARGIN * np.abs(np.mean(larger, axis=0)))


def _beyond_spread(gained: Floats, margin: Any) -> Any:
    with np.errstate(invalid="ignore"):
        spread = gained.std(axis=0, ddof=1) if len(gained) > 1 else 0.0
    return (gained.mean(axis=0) > margin) & (gained.mean(axis=0) > spread)


def statement(core: Iterable[bool], further: Iterable[bool], measured: str) -> Judgement:
    """Judge a statement and what stands beside it.

    Reproduced where all holds; the same direction where the statement itself holds in more than half of its parts, and
    more than half of all parts hold.
    """
    own, other = [bool(each) for each in core], [bool(each) for each in further]
    direction = sum(own) > len(own) / 2 and sum(own + other) > len(own + other) / 2
    counted = f"{sum(own)} of {len(own)}, beside it {sum(other)} of {len(other)}"
    return graded(all(own + other), direction, f"{measured} ({counted})")


def by_one_session(sessions: Iterable[Floats], measured: str) -> Judgement:
    """Judge what the paper saw once: by sessions that are independent, differences (robots,), positive where it shows.

    The next robot's is positive with a probability by Student's distribution, its spread that over robots.
    """
    chance = 1.0
    for gained in map(np.asarray, sessions):
        n = len(gained)
        chance *= stats.t.cdf(gained.mean() / (gained.std(ddof=1) * np.sqrt(1.0 + 1.0 / n)), n - 1) if n > 1 else 0.5
    text = f"{measured}; one session shows it with a probability of {chance:.2f}"
    if 1.0 - _SURE < chance < _SURE:
        return Judgement("cannot be judged by one session", text)
    return graded(chance >= _SURE, False, text)


def near(
    reached: Mapping[str, Floats], published: Mapping[str, float], share: float, *, direction: Iterable[bool]
) -> Judgement:
    """Judge numbers (robots,) by name: reproduced where each mean is within a share of the published one."""
    close = all(
        abs(values.mean() - published[name]) <= share * abs(published[name]) for name, values in reached.items()
    )
    return graded(close, all(direction), as_text({name: by_robot(values) for name, values in reached.items()}))


def by_joint(*samples: Floats, digits: int = 3, unit: str = "") -> str:
    """Return samples (robots, 3) joint by joint, mean and spread: "J1 0.104 ± 0.012, J2 ..."; several by commas."""
    texts = [
        f"{joint} " + ", ".join(f"{_in_text(each[:, j], digits)}{unit}" for each in samples)
        for j, joint in enumerate(JOINTS)
    ]
    return ("; " if len(samples) > 1 else ", ").join(texts)


def _in_text(values: Floats, digits: int) -> str:
    return mean_and_spread(values, digits).replace("-0 ±", "0 ±")


def changes(before: Floats, after: Floats) -> str:
    """Return by how many per cent errors (robots, 3) change, mean and spread over robots, joint by joint."""
    return by_joint(100.0 * (after / before - 1.0), digits=0, unit=" %")
