"""Six hours of figure 6, made up on both sides of its claims' criteria."""

from functools import partial
from typing import Any

from papers.calibration import published
from papers.calibration.figure_6 import SHOWN
from papers.calibration.recordings import NETWORK
from papers.calibration.sessions import HOURS
from papers.calibration.six_hours import LONG, OFFSET, cases_of, six_hours
from papers.experiment import Outcomes, Scope
from tests.papers.made_up.row import Row


def lost(
    idle: float = 1.0,
    unloaded: float = 1.0,
    loaded: float = 1.0,
    *,
    joint_1: float = 1.0,
    short: tuple[float, float] = (1.3, 1.1),
    polynomial: float = 2.0,
) -> Outcomes:
    """Return errors that start at the paper's and grow by a share of the paper's growth.

    Args:
        idle: The share, in idle hours.
        unloaded: In hours of motion without a load.
        loaded: With 500 g.
        joint_1: The same of joint 1 alone, which the loss is multiplied by.
        short: Errors of training sets up to 800 s over those of longer ones, of regressions and of networks.
        polynomial: On joints 2 and 3, of which the paper has no numbers, its errors over the linear model's.
    """
    loss = {"idle": idle, "unloaded": unloaded, "loaded": loaded}

    def hours(condition: str, model: str, name: str) -> list[dict[str, Any]]:
        known = published.SIX_HOURS[condition]
        first, last = (list(each) for each in known.get(model, known["linear"]))
        if model == "polynomial":
            ends = zip(published.SIX_HOURS_POLYNOMIAL_J1[condition], (first, last), strict=True)
            first, last = ([end, *(polynomial * value for value in each[1:])] for end, each in ends)
        by = 1.0 if name in LONG or model == OFFSET else short[model == NETWORK]
        told = []
        for hour in HOURS[condition]:
            share = loss[condition] * hour / 5.0
            errors = [a + share * (b - a) for a, b in zip(first, last, strict=True)]
            errors[0] = first[0] + joint_1 * (errors[0] - first[0])
            errors = [by * error for error in errors]
            told.append({"errors": errors, "guarded": errors, "tip": [1.0] * 4, "outside": 0.0})
        return told

    def result(arguments: dict[str, Any]) -> dict[str, Any]:
        condition, sets = arguments["condition"], arguments["sets"]
        return {model: {name: hours(condition, model, name) for name in sets} for model in SHOWN}

    cases = cases_of(Scope(robots=(None, 1), networks=1))
    return Outcomes({case: result(case.arguments) for case in cases if case.function == six_hours.name})


FIGURE = "calibration-figure-6"
FIRST, LAST = published.SIX_HOURS["loaded"]["network"]
EVERY_HOUR = " | ".join(f"{FIRST[0] + hour / 5.0 * (LAST[0] - FIRST[0]):.3f} ± 0.000" for hour in range(6))
ROWS = [
    Row(FIGURE, "the paper's hours", lost, "r" * 17, [f"loaded, network | 3 longest | {EVERY_HOUR}", "idle, linear | 3 longest",
        f"loaded, network | 3 shortest | {1.1 * FIRST[0]:.3f} ± 0.000"], "y" * 15 + ".y"),
    Row(FIGURE, "load does not wear", partial(lost, idle=0.0, loaded=0.0), "r..nnn..........."),
    Row(FIGURE, "a loss of a few per cent", partial(lost, idle=0.0, unloaded=0.05, loaded=0.05), "n................"),
    Row(FIGURE, "joints lose alike", partial(lost, idle=0.0, joint_1=0.2), ".n....n.........."),
    Row(FIGURE, "training sets and models are alike", partial(lost, short=(1.0, 1.0), polynomial=1.0), "...........rrnnnn"),
    Row(FIGURE, "longer training gains three per cent", partial(lost, short=(1.03, 1.03)), "..............n.n"),
    Row(FIGURE, "nothing is lost", partial(lost, idle=0.0, unloaded=0.0, loaded=0.0), "nn.nn......nn...."),
    Row(FIGURE, "all conditions wear more", partial(lost, idle=20.0, unloaded=5.0, loaded=5.0), "..n....nsnn......"),
]  # fmt: skip
