"""Gravity sensed on bases that turn, accelerate and shake: what is claimed of it beside the truth and three baselines."""

import re
from collections.abc import Iterator

from tests.benchmarks.shaken_base import ROWS, row
from tests.truth.bench import FAILS, HOLDS, NAMED, Outcome

SEED = 1  # odd: the estimator was developed on even ones
CLOSE = 1.1  # times the best baseline's error, that it may have
LIVE_WITHIN, LIVE_SHARE = 0.2, 0.9  # [m/s2] error of the best baseline where gravity must be live so often
WRONG_S = 0.5  # [s] of live gravity off by more than 0.3 m/s2
SMALL = 0.15  # [m/s2] RMS error that is small


def sensed_gravity(only: str) -> Iterator[Outcome]:
    """Try the bases whose name a regular expression finds."""
    yield from (_tried(name) for name in ROWS if re.search(only, f"gravity: {name}"))


def _tried(name: str) -> Outcome:
    base = ROWS[name][0]
    baselines, off, _, live, wrong, faults, _, remedy = row(name, SEED)
    best = min(baselines.values())
    is_wrong_gyroscope = bool(base.late or (base.rate_as.diagonal() != 1.0).any())
    doubts = []
    if wrong > WRONG_S:
        doubts.append("live and wrong")
    if bool(remedy) != is_wrong_gyroscope:
        doubts.append("accused" if remedy else "not accused")
    is_good = off <= max(CLOSE * best, SMALL) and (best > LIVE_WITHIN or live > LIVE_SHARE)
    verdict = f"{FAILS}: {', '.join(doubts)}" if doubts else HOLDS if is_good else NAMED
    reasons = ", ".join(fault for fault, _ in faults.most_common(2))
    claim = f"{off:.2f} m/s2, live {100.0 * live:.0f} %" + f"; {reasons}" * bool(reasons)
    others = ", ".join(f"{what} {error:.2f}" for what, error in baselines.items())
    return Outcome(f"gravity: {name}", claim, f"{others}; {wrong:.1f} s live and wrong", verdict)
