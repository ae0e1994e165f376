"""Results of the regressor paper's experiments and of the tutorial's, made up on both sides of their criteria."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from papers.experiment import Case, Outcomes, Scope
from papers.regressor import dual_arm, figure_2, figure_4, figure_5, payload, replay
from papers.regressor.decomposition import decomposition
from papers.regressor.evaluation_time import evaluation
from papers.regressor.unknown_payload import LOOKED_AT
from papers.tutorial import two_link
from tests.papers.made_up.row import Row

TWO = Scope(robots=(None, 1))


@cache
def taken_apart() -> dict[Case, Any]:
    """Return results of figure 2's quick cases, which take a moment."""
    return {case: case.load()(**case.arguments) for case in figure_2.cases(Scope(quick=True))}


def decomposed(ratios: tuple[float, ...] = (), change: Mapping[str, Any] | None = None) -> Outcomes:
    """Return figure 2's with measured ratios of time, and with a change of what is printed of each robot."""
    results: dict[Case, Any] = {
        case: {**result, **(change or {})} if case.function == decomposition.name else result
        for case, result in taken_apart().items()
        if not ratios or case.function == decomposition.name
    }
    for name, ratio in zip(("planar_3r", "dual_arm_19", "panda"), ratios, strict=False):
        timed = {"full_us": ratio, "compact_us": 1.0, "ratio": ratio}
        results[evaluation.case(robot=name, repeats=1)] = timed
    return Outcomes(results)


def levels(
    told: Mapping[str, float], *, before: float = 0.5, first: float | None = None, after: float = 1.0
) -> Outcomes:
    """Return every window of a controller at one level, robots alike.

    Args:
        told: Level by controller, 0.5 elsewhere.
        before: Level in the window before estimation.
        first: Level of the first robot under PD alone with printed gains; as the others where None.
        after: What windows at rest are multiplied by.
    """
    results = {}
    for case in [*figure_4.cases(TWO), *figure_5.cases(TWO)]:
        level = told.get(case.arguments["controller"], 0.5)
        windows = {
            name: dict.fromkeys(dual_arm.LIMBS, level * (after if "rest" in name else 1.0)) for name in dual_arm.WINDOWS
        }
        windows["before estimation"] = dict.fromkeys(dual_arm.LIMBS, before)
        if first is not None and case == figure_5.cases(TWO)[0]:
            windows = {name: dict.fromkeys(dual_arm.LIMBS, first) for name in dual_arm.WINDOWS}
        results[case] = {"rms_deg": windows, "errors_deg": np.full((19, 311), level).tolist()}
    return Outcomes(results)


def replayed(left: float) -> Outcomes:
    result = {
        "axes": [f"q{k}" for k in range(1, 8)],
        "units": ["rad"] * 7,
        "rows": [100, 60],
        "rms_Nm_or_N": {"none": [1.0] * 7, "law": [left] * 7, "least squares": [0.1] * 7},
        "row": [0, 50, 99],
        "torque_Nm_or_N": {name: [[0.0, 1.0, 0.5]] * 7 for name in replay.COLORS},
    }
    return Outcomes({replay.replay.case(recording=name, rows=None): result for name in replay.RECORDINGS})


def seen(probability: float, right: bool, no_load: float = 0.0) -> list[dict[str, Any]]:
    errors = dict.fromkeys(("mass_error_kg", "mass_error_there_kg", "mass_std_kg"), 0.1)
    stated = {"no_load": no_load, "right": right, "probability": probability, "likely": 1, "among_likely": right}
    return [{"poses": poses, **stated, **errors} for poses in LOOKED_AT]


def loads(right: int, probability: float = 0.95, mass: float = 0.3) -> list[dict[str, Any]]:
    """Return five loaded trials, of which so many name the link that carries the load."""
    told = {"link": 2, "mass_kg": mass, "alarm": False}
    return [{**told, "seen": seen(probability, number < right)} for number in range(5)]


UNLOADED = {"link": 0, "mass_kg": 0.0, "alarm": False, "seen": seen(0.9, False, 0.99)}
SURE = [{"link": 2, "mass_kg": 1.0, "alarm": False, "seen": seen(1.0, True)}] * 100


def carried(usual: list[dict[str, Any]], others: list[dict[str, Any]] | None = None) -> Outcomes:
    """Return trials of the estimator as it comes, and of it under other conditions."""

    def trials(case: Case) -> list[dict[str, Any]]:
        is_usual = (case.arguments["noise_ratio"], case.arguments["told_sizes"]) == payload.USUAL
        return usual if is_usual or others is None else others

    return Outcomes({case: {"trials": trials(case)} for case in payload.cases(Scope(robots=(None,)))})


def two_links(
    full: float, at_rest: Callable[[str], float] = lambda name: 0.0 if "gravity" in name else 0.5
) -> Outcomes:
    """Return the largest error under the whole law, and 5 deg under others."""
    return Outcomes(
        {
            case: {
                "largest_deg": [full if case.arguments["controller"] == two_link.FULL else 5.0] * 2,
                "at_rest_deg": [at_rest(case.arguments["controller"])] * 2,
                "time_s": [0.0, 0.1],
                "error_deg": [[0.0, 1.0]] * 2,
            }
            for case in two_link.cases(Scope())
        }
    )


F2, F4, F5 = (f"regressor-figure-{number}" for number in (2, 4, 5))
LEARNS = {"printed-pd": 0.5, "printed-compact": 0.1, "printed-full": 0.1, "printed-longer": 0.05}
ROWS = [
    Row(F2, "as it is computed", decomposed, "rrrrr", ["planar_3r | 3 x 36 | 30 | 0 | 6 to 3"]),
    Row(F2, "all robots are faster", partial(decomposed, (1.5, 8.0, 2.0)), "....r", ["full over compact: planar_3r 1.5, dual_arm_19", "8.00"]),
    Row(F2, "one is slower", partial(decomposed, (1.5, 8.0, 0.9)), "....s"),
    Row(F2, "most are slower", partial(decomposed, (0.9, 0.8, 2.0)), "....n"),
    Row(F2, "other entries", partial(decomposed, change={"entries": [["c1", "c12", "c123"]] * 3}), ".n..."),
    Row(F2, "other blocks, another width, other torques",
        partial(decomposed, change={"blocks": [["1"] * 12] * 3, "shape": [3, 30], "largest_difference_Nm": 1e-3}), "n.nn."),
    Row(F4, "it learns", partial(levels, LEARNS), "rr"),
    Row(F4, "PD alone gets better, and sags", partial(levels, {"printed-pd": 5.0}, before=50.0), "nn"),
    Row(F5, "it learns", partial(levels, LEARNS), "r.rr"),
    Row(F5, "some error is left", partial(levels, LEARNS, after=4.0), ".r.."),
    Row(F5, "it does harm", partial(levels, {"printed-pd": 0.5, "printed-compact": 0.6, "printed-full": 0.6, "printed-longer": 0.7}), "nnnn"),
    Row(F5, "each against PD with its own damping", partial(levels, {"rls": 0.04, "printed-pd": 1.0, "printed-compact": 0.25}), "....",
        ["least squares, from zero: reached", "law on the compact Z, from zero: not reached"]),
    Row(F4, "one robot differs", partial(levels, LEARNS, first=0.7), "..", ["trunk 0.60 ± 0.14 to 0.60 ± 0.14 deg, left arm"]),
    Row(F5, "one robot differs", partial(levels, LEARNS, first=0.7), "....",
        ["law on the compact Z, from zero: 0.500 ± 0.000 to 0.100 ± 0.000 deg", "from zero, rest in pose two: 0.100 ± 0.000 deg",
         "law on the full Z, from zero, rest in pose one: 17 ± 4 %", "rest in pose one: 0.100 ± 0.000 to 0.050 ± 0.000 deg"]),
    Row("regressor-replay", "the law foretells", partial(replayed, 0.2), "rn"),
    Row("regressor-replay", "it does not", partial(replayed, 0.8), "nr"),
    Row("regressor-payload", "stated as it is", partial(carried, [*loads(4, 0.8), UNLOADED]), "..", ["false alarms | 7 | 0 %", "1 | 5 | 100 % | 80 %"]),
    Row("regressor-payload", "right, but under other conditions", lambda: carried(loads(5), loads(0)), "rr"),
    Row("regressor-payload", "wrong, but under other conditions", lambda: carried(loads(3), loads(2)), "nn",
        ["stated 95.0 % on average, right 60.0 % of 25."]),
    # each bin of stated probabilities counts, not the many that are sure
    Row("regressor-payload", "wrong where it is not sure", lambda: carried([*loads(3), *SURE]), "n.",
        ["stated 95.0 % right 60.0 %, 100.0 % right 100.0 % (1 of 2)"]),
    Row("regressor-payload", "right everywhere", lambda: carried([*loads(5), *SURE]), "r."),
    Row("tutorial-two-link", "the page's", partial(two_links, 0.5), "rrr"),
    Row("tutorial-two-link", "the whole law is worse", partial(two_links, 9.0), "rnn"),
    Row("tutorial-two-link", "gravity is not cancelled", partial(two_links, 0.5, lambda name: 0.5), "n.."),
]  # fmt: skip
