"""Verdicts on results that are made up, on both sides of each criterion: of one or two experiments of each paper."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import pytest

from catenary.trajectories.zigzag import DIRECTIONS
from papers.beyond import day_after
from papers.calibration import ablation, published, table_1
from papers.catalog import MODULES, experiment
from papers.experiment import NOMINAL, Case, Outcomes, Result, Scope
from papers.gravity import figure_9, sensing
from papers.gravity.tracking import follow_sinusoids
from papers.regressor import replay
from papers.results_files import judged
from papers.tutorial import two_link


class Row(NamedTuple):
    """Results that are made up, and the verdicts on them."""

    experiment: str
    told: str  # what is made up
    outcomes: Callable[[], Outcomes]
    verdicts: str  # a letter of each claim: reproduced, same direction, not reproduced; a dot where it is not asked
    shows: Sequence[str] = ()  # what tables, remarks and measured values must hold


def all_of(cases: Sequence[Case], result: Callable[[Case], Any]) -> Outcomes:
    return Outcomes({case: result(case) for case in cases})


def directions(errors: Mapping[str, Mapping[str, tuple[float, ...]]]) -> Outcomes:
    """Return table I's errors by direction and method; robots are the same but for their size."""

    def result(case: Case) -> Result:
        by = 1.0 + 0.1 * (case.arguments["seed"] or 0)
        found = {**errors[case.arguments["direction"]], table_1.BEST: (0.05,) * 3}
        return {method: [by * error for error in values] for method, values in found.items()}

    return all_of(table_1.cases(Scope(robots=(None, 1, 2), networks=2)), result)


def tied() -> Outcomes:
    """Return the paper's but for a tie of network and linear model, and joint 3 the other way round."""
    anew = {"network": (0.3, 0.3, 0.17), "linear": (0.3, 0.301, 0.166)}
    return directions({direction: {**published.TABLE_1[direction], **anew} for direction in DIRECTIONS})


def turned() -> Outcomes:
    """Return errors of each method that are those of another one: what was best is worst."""
    return directions(
        {name: dict(zip(by, list(by.values())[::-1], strict=True)) for name, by in published.TABLE_1.items()}
    )


def ablated(**errors: Any) -> Outcomes:
    """Return errors by features, and of positions and torques with one more group."""
    features = {
        ablation.POSITIONS: [0.3] * 3,
        ablation.TORQUES: [0.5, 0.5, 0.2],
        ablation.BOTH: [0.1] * 3,
        ablation.ALL: [0.7, 0.7, 0.4],
        **errors,
    }

    def result(case: Case) -> Result:
        left = features.get(case.arguments["features"], [0.1] * 3)
        shuffled = {model: {name: [0.2, 0.3, 0.4] for name in ablation.SHUFFLED} for model in ablation.MODELS}
        return {**dict.fromkeys(ablation.MODELS, left), "inputs": 16, "shuffled": shuffled}

    return all_of(ablation.cases(Scope(robots=(None, 1))), result)


def followed(pd: float, sg: float, dg: float, tips: Mapping[str, float] | None = None) -> Result:
    """Return what following a motion left on joint 1 by controller."""
    return {
        f"{name} absolute": {
            "controller": name,
            "damping": "absolute",
            "rms_error": [error, 0.5, 3.7 if name == "pd" else 3.6],
            "pd_share": [0.5] * 3,
            "rms_torque": [1.0] * 3,
            "tip_mm": [1.0, 1.0, 1.0, (tips or {}).get(name, 2.0)],
            "true_tip_mm": 9.0,
        }
        for name, error in (("pd", pd), ("sg", sg), ("dg", dg))
    }


def rocked(dg: float, *tips: float) -> Outcomes:
    """Return errors on a rocking base; on bases at rest DG's is below SG's by more the more they are tilted."""
    told = {
        "rocking": followed(1.0, 0.99, dg, dict(zip(("pd", "sg", "dg"), tips, strict=False))),
        **{base: followed(1.0, 0.95, 0.95 - drop) for base, drop in {"10": 0.02, "15": 0.08, "20": 0.12}.items()},
    }
    return Outcomes(
        {
            follow_sinusoids.case(seed=None, base=base, way="increments", controllers=figure_9.USUAL): result
            for base, result in told.items()
        }
    )


def sensed(accelerometer: float) -> Outcomes:
    rows = {sensing.LEVEL_BASE: 40.0, sensing.ATTITUDE: 20.0, sensing.ACCELEROMETER: accelerometer}
    return all_of(sensing.cases(Scope()), lambda _: {name: [value] * 4 for name, value in rows.items()})


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


def two_links(full: float, without_gravity: float = 0.0) -> Outcomes:
    """Return the largest error under the whole law, 5 deg under others; what terms with gravity leave at rest."""

    def result(case: Case) -> Result:
        name = case.arguments["controller"]
        return {
            "largest_deg": [full if name == two_link.FULL else 5.0] * 2,
            "at_rest_deg": [without_gravity if "gravity" in name else 0.5] * 2,
            "time_s": [0.0, 0.1],
            "error_deg": [[0.0, 1.0]] * 2,
        }

    return all_of(two_link.cases(Scope()), result)


def next_day(*over: float) -> Outcomes:
    """Return errors after five minutes that are so many times those of a model of all of the day, joint by joint."""
    stages = {stage: [1.0] * 3 for stage in day_after.STAGES} | {day_after.FIVE: list(over)}
    cases = day_after.cases(Scope(robots=(NOMINAL, 1)))
    simulated = [case for case in cases if case.function == day_after.simulated_day.name]
    return all_of(simulated, lambda _: dict.fromkeys(day_after.MODELS, stages))


T1, ABLATION, TENTH = "calibration-table-1", "calibration-ablation", "gravity-figure-10"
CONTRARY = {ablation.BOTH: [0.8] * 3, ablation.POSITIONS: [0.5, 0.5, 0.1], ablation.TORQUES: [0.3] * 3}
ROWS = [
    # the paper's polynomial and linear model of joint 2 rank third and second
    Row(T1, "the paper's table", lambda: directions(dict(published.TABLE_1)), "rsrrr", ["0.", "±"]),
    Row(T1, "a tie of network and linear model", tied, "n...."),
    Row(T1, "methods the other way round", turned, "n.nnn"),
    Row(ABLATION, "the paper's conclusions", ablated, "rrr", ["2.00 ± 0.00"]),  # 0.2 of 0.1
    Row(ABLATION, "their contrary", lambda: ablated(**CONTRARY), "nnn"),
    Row(TENTH, "the paper's", partial(rocked, 0.88, 2.0, 2.01, 1.98), "rrr"),
    Row(TENTH, "a gain below those at rest", partial(rocked, 0.98, 2.0, 2.2, 2.3), "..s"),
    Row(TENTH, "no gain", partial(rocked, 0.99, 2.0, 2.2, 2.3), "snn"),
    Row("gravity-sensing", "each sensor leaves less", partial(sensed, 10.0), "rr", [f"{sensing.ACCELEROMETER} | 10.00"]),
    Row("gravity-sensing", "the last one leaves more", partial(sensed, 30.0), "nn"),
    Row("regressor-replay", "the law foretells", partial(replayed, 0.2), "rn"),
    Row("regressor-replay", "it does not", partial(replayed, 0.8), "nr"),
    Row("tutorial-two-link", "the page's", partial(two_links, 0.5), "rrr"),
    Row("tutorial-two-link", "the whole law is worse", partial(two_links, 9.0), "rnn"),
    Row("tutorial-two-link", "gravity is not cancelled", partial(two_links, 0.5, 0.5), "n.."),
    Row("beyond-day-after", "within 15 %", partial(next_day, 1.0, 1.0, 1.1), "r", ["6 of 6", "1.10 at worst"]),
    Row("beyond-day-after", "in the median", partial(next_day, 1.0, 1.0, 1.2), "s"),
    Row("beyond-day-after", "on one joint", partial(next_day, 1.0, 1.2, 1.2), "n"),
]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.experiment}: {row.told}")
def test_made_up_results_are_judged_and_shown_as_they_are(row: Row) -> None:
    one, outcomes = experiment(row.experiment), row.outcomes()
    found = [judgement for _, judgement in judged(one, outcomes)]
    assert len(row.verdicts) == len(found)
    letters = "".join(each.verdict[0] for each in found)
    assert "".join(x if wanted != "." else "." for x, wanted in zip(letters, row.verdicts, strict=True)) == row.verdicts
    if row.shows:
        report = one.report(outcomes)
        lines = [" | ".join(line) for titled in report.tables for line in titled.table.rows]
        text = "\n".join([*lines, *report.remarks, *(each.measured for each in found)])
        assert [words for words in row.shows if words not in text] == [], text


@pytest.mark.parametrize("name", MODULES)
def test_nothing_is_claimed_of_what_was_not_measured(name: str) -> None:
    assert {found.verdict for _, found in judged(experiment(name), Outcomes({}))} <= {"not measured"}
