"""Results of the calibration paper's experiments, made up on both sides of their criteria."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from catenary.trajectories.zigzag import DIRECTIONS
from papers.calibration import (
    ablation,
    figure_3,
    figure_5,
    figure_8,
    figure_9,
    published,
    table_1,
    table_2,
    table_3,
    table_5,
)
from papers.calibration.all_inputs import LARGER, all_inputs, sizes
from papers.calibration.homings import BASELINE, METHODS_SHOWN, NONE, ONE
from papers.calibration.peer_hours import PEERS, PROCESS, UKF, peer_hours
from papers.calibration.recordings import NETWORK, SETS
from papers.calibration.six_hours import LONGEST, MODELS, OFFSET, RAW, six_hours
from papers.calibration.sparsities import SHORT, SHOWN, parts
from papers.experiment import NOMINAL, Case, Outcomes, Result, Scope
from tests.papers.made_up.row import Row
from tests.papers.made_up.six_hours import ROWS as SIX_HOURS

TWO = Scope(robots=(NOMINAL, 1), networks=1)
SECONDS = {"1/2": 204.0, "1/3": 328.0, "1/4": 483.0, "1/5": 670.0, "1/6": 888.0}  # of recordings of figure 5


def all_of(cases: Sequence[Case], result: Callable[[Case], Any]) -> Outcomes:
    return Outcomes({case: result(case) for case in cases})


def path(slower: float = 1.0) -> Outcomes:
    """Return paths that are all that the paper says, recorded for so many times as long."""

    def result(case: Case) -> Result:
        told = case.arguments
        direction, sparsities = told["direction"].split("-"), told["sparsities"]
        half = published.BOX_SHARES[len(direction)] / 2.0
        seconds = published.DURATIONS.get(tuple(sparsities), 1000.0 * sum(1.0 / s for s in sparsities))
        return {
            "seconds": slower * seconds,
            "low": [0.5 - half] * 3,
            "high": [0.5 + half] * 3,
            "even": [1.0 if joint in direction else 0.1 for joint in ("J1", "J2", "J3")],
            "reversals": [8, 2, 0],
            "volume": 0.192,
            "hole": min(sparsities),
            "corners": [[20.0, 55.0, 330.0], [60.0, 110.0, 420.0]],
        }

    return all_of(figure_3.cases(Scope(robots=(None,))), result)


def other_path() -> Outcomes:
    """Return paths that are nothing of what the paper says."""

    def result(case: Case) -> Result:
        count = len(case.arguments["direction"].split("-"))
        found = {"seconds": 10.0, "low": [0.0] * 3, "high": [0.3 * count] * 3, "even": [0.5] * 3, "volume": 0.3 * count}
        return found | {"reversals": [1, 1, 1], "hole": 0.1, "corners": [[0.0, 0.0, 0.0], [180.0, 180.0, 900.0]]}

    return all_of(figure_3.cases(Scope(robots=(None,))), result)


def directions(errors: Mapping[str, Mapping[str, tuple[float, ...]]]) -> Outcomes:
    """Return errors by direction and method; robots are the same but for their size."""

    def result(case: Case) -> Result:
        by = 1.0 + 0.1 * (case.arguments["seed"] or 0)
        found = {**errors[case.arguments["direction"]], table_1.BEST: (0.05,) * 3}
        return {method: [by * error for error in values] for method, values in found.items()}

    return all_of(table_1.cases(Scope(robots=(None, 1, 2), networks=2)), result)


def table_1_ties() -> Outcomes:
    """Return the paper's but for a tie of network and linear model, and joint 3 the other way round."""
    anew = {"network": (0.3, 0.3, 0.17), "linear": (0.3, 0.301, 0.166)}
    return directions({direction: {**published.TABLE_1[direction], **anew} for direction in DIRECTIONS})


def table_1_turned() -> Outcomes:
    """Return errors of each method that are those of another one: what was best is worst."""
    found = {}
    for direction, methods in published.TABLE_1.items():
        found[direction] = dict(zip(methods, list(methods.values())[::-1], strict=True))
    return directions(found)


def table_1_halved() -> Outcomes:
    """Return the paper's errors, but half of them in its own direction."""
    found = {direction: dict(methods) for direction, methods in published.TABLE_1.items()}
    best = found[table_1.PAPERS_CHOICE]
    return directions(
        found | {table_1.PAPERS_CHOICE: {m: tuple(0.5 * e for e in errors) for m, errors in best.items()}}
    )


def sparse(change: Callable[[dict[str, Any]], Mapping[str, Any]] = lambda found: {}) -> Outcomes:
    """Return errors that are figure 5's, and spread as it says, with a change."""

    def result(case: Case) -> Result:
        name = case.arguments["name"]
        seconds = sum(SECONDS[part] for part in parts(name))
        span = "short" if seconds < SHORT else "long"
        share = min(1.0, 209.0 / seconds)
        found: dict[str, Any] = {"seconds": seconds, "outside": 0.1}
        for method in SHOWN:
            if method == OFFSET:
                errors = [0.846, 1.1, 0.5]
            elif method == "polynomial":
                errors = [0.834 if name == "1/2" else 0.119, 0.302 + 0.7 * share, 0.5 * share + 0.14]
            else:
                j1 = published.FIGURE_5_J1["1/2" if name == "1/2" else "1/2+1/3+1/4"][method]
                j3 = published.FIGURE_5_J3["short" if span == "short" else "1/2+1/3"][method]
                errors = [j1, published.FIGURE_5_J2[span][method], j3]
            spread = share * (0.2 if method == "polynomial" else 0.01)
            found[method] = [[error + k * spread for error in errors] for k in (-1.0, 0.0, 1.0)]
        return found | change(found)

    return all_of(figure_5.cases(Scope(robots=(NOMINAL, 1), networks=2)), result)


def alike(level: float, by_second: float = 0.0) -> Callable[[dict[str, Any]], Mapping[str, Any]]:
    return lambda found: {method: [[level - by_second * found["seconds"]] * 3] * 3 for method in SHOWN}


def gaining(found: dict[str, Any]) -> Mapping[str, Any]:
    errors = {method: (1.0 + (method == OFFSET)) * 100.0 / found["seconds"] for method in SHOWN}
    return {method: [[error] * 3] * 3 for method, error in errors.items()}


def inputs(
    scale: float = 1.0,
    larger: Sequence[float] | None = None,
    *,
    papers_sizes: bool = True,
    few: float = 1.0,
    polynomial: float = 1.0,
) -> Outcomes:
    """Return figure 8's numbers; those of 138 and of few inputs times factors, the larger network's as they are told."""

    def errors(model: str, columns: str) -> list[float]:
        if model == "fixed offset":
            return [1.0, 1.1, 0.5]
        if columns == "16":
            return [few * value for value in published.INPUTS_16.get(model, (1.0, 2.0, 1.0))]
        return [scale * value for value in published.INPUTS_138.get(model, (3.0, 3.0, 3.0))]

    def result(case: Case) -> Result:
        told = case.arguments
        if case.function == all_inputs.name:
            found: dict[str, Any] = {
                "polynomial": {
                    name: [[polynomial * e for e in errors("polynomial", "all")]] * 6 for name in told["sets"]
                },
                LARGER: {name: [list(larger or errors(LARGER, "all"))] * 6 for name in told["sets"]},
            }
            return found | {"ranks": {name: [40, 860, 840] for name in told["sets"]}}
        if case.function == sizes.name:
            return {name: count + (not papers_sizes) for name, count in published.PARAMETERS.items()}
        return {
            model: {name: [{"errors": errors(model, told["columns"])}] * 6 for name in told["sets"]}
            for model in ("fixed offset", *told["models"])
        }

    return all_of(figure_8.cases(TWO), result)


def end_to_end(
    by: float = 1.0, last: float = 0.2, *, network: str = "network", converged: float = 0.1, regressions: float = 1.0
) -> Outcomes:
    """Return table II; errors end to end are the paper's times factors; `last`, the network's after most epochs."""

    def result(case: Case) -> Result:
        target = case.arguments.get("target")
        if case.function == table_2.more_epochs.name:
            return {"error": [converged] * 3, "position": [[1.0] * 3, [0.5] * 3, [last] * 3]}
        errors = {model: published.TABLE_2[model][int(target == "position")] for model in table_2.SHOWN}
        if target == "position":
            factors = {"network": by}
            errors = {m: tuple(factors.get(m, regressions) * value for value in errors[m]) for m in errors}
        errors["network"] = errors[network]
        found = {model: list(values) for model, values in errors.items()}
        return {m: {name: [{"errors": found[m]}] * 6 for name in case.arguments["sets"]} for m in table_2.SHOWN}

    return all_of(table_2.cases(TWO), result)


RISING = [0.25, 0.3, 0.4, 0.5, 0.55, 0.63]


def homings(none: list[float], one: list[float], *, others_by: float = 1.0) -> Outcomes:
    """Return errors of every method: joint 2 by chain and homing, the others flat but for a factor."""
    joint_2 = {BASELINE: [0.25] * 6, NONE: none, ONE: one}

    def joints(chain: str) -> list[list[float]]:
        by = [others_by if chain == NONE and k else 1.0 for k in range(6)]
        return [[0.2 * by[k], error, 0.2 * by[k]] for k, error in enumerate(joint_2[chain])]

    def result(case: Case) -> Result:
        return {
            chain: {
                **{method: [joints(chain)] * 5 for method in METHODS_SHOWN},
                "outside": [[0.0] + [1.0] * 5] * 5,
                "tool": [[0.0] + [30.0] * 5] * 5,
            }
            for chain in ([ONE] if case.arguments["seen"] else [BASELINE, NONE])
        }

    return all_of(figure_9.cases(Scope(robots=(NOMINAL, 1), networks=2)), result)


HOUR_5 = {"errors": [9.0] * 3, "tip": [9.0] * 4}


def hours(first: float, last: float) -> list[dict[str, Any]]:
    """Return errors of three joints and four numbers of the tip that rise evenly over six hours."""
    return [{"errors": [v] * 3, "tip": [v] * 4} for v in np.linspace(first, last, 6).tolist()]


def between(ends: Sequence[tuple[float, float]], kind: str) -> list[dict[str, Any]]:
    return [{**HOUR_5, kind: [pair[k > 0] for pair in ends]} for k in range(6)]


def beside_peers(
    network: list[dict[str, Any]],
    peers: Mapping[str, Any] | None = None,
    *,
    raw: float = 1.0,
    linear: list[dict[str, Any]] | None = None,
) -> Outcomes:
    def result(case: Case) -> Result:
        if case.function == peer_hours.name:
            identified = {"identified": {"stiffness": [50.0, 60.0, 7e4]}}
            return {name: hours(8.0, 9.0) for name in PEERS} | dict(peers or {}) | identified
        found = {name: {SETS[-1]: hours(1.0, 2.0)} for name in MODELS}
        found |= {RAW: {SETS[-1]: hours(raw, raw)}, OFFSET: {SETS[-1]: hours(5.0, 6.0)}}
        found["linear"] = {SETS[-1]: linear or hours(1.0, 2.0)}
        return found | {"network": {SETS[-1]: network}}

    return all_of(table_3.cases(TWO), result)


def papers_range(kind: str) -> Outcomes:
    ours = published.TABLE_3_OURS if kind == "errors" else published.TABLE_4_OURS
    return beside_peers(between(ours["network"], kind), linear=between(ours["linear"], kind))


LINEAR = np.array([0.4, 0.6, 0.5])


def aspects(*, papers: bool, gains: Sequence[float] | None = None) -> Outcomes:
    """Return table V's aspects as the paper has them, or their contrary; or a gain of the network by robot."""

    def six(told: dict[str, Any], model: str, name: str) -> list[Any]:
        errors = LINEAR.copy()
        if model == "network" and gains is not None and told["target"] == "error":
            errors = errors * (1.0 - gains[told["seed"] or 0])
        elif model == "network":
            by = 0.0 if told["condition"] == "unloaded" and name in LONGEST else 0.1
            errors = errors - by if papers else errors + by
        if told["target"] == "position":
            errors = errors * {("network", True): 3.0, ("network", False): 0.9}.get(
                (model, papers), 1.0 if papers else 1.2
            )
        if told["columns"] == "stamped" and model == "linear" and papers:
            errors = 5.0 * errors
        return [{"errors": errors.tolist()}] * 6

    def result(case: Case) -> Result:
        told = case.arguments
        if case.function == six_hours.name:
            return {model: {name: six(told, model, name) for name in told["sets"]} for model in told["models"]}
        if case.function == all_inputs.name:
            return {m: {name: [[0.5, 0.7, 0.6]] * 6 for name in told["sets"]} for m in ("polynomial", LARGER)}
        if case.function == sizes.name:
            return {}
        slow, fast = (61_000.0, 380.0) if papers else (100.0, 200.0)
        return {
            "processor": "made up",
            "recorded": 1013.0 if papers else 10.0,
            "rows": 30_000,
            "train": {"network": 40.0 if papers else 100.0, "linear": 1.0 if papers else 101.0},
            "framework": {"network": slow, "linear": fast},
            "deployed": {"network": 10.0, "linear": 1.0},
        }

    return all_of(table_5.cases(Scope(robots=(None, 1, 2), networks=2)), result)


POSITIONS, TORQUES, BOTH, ALL = ablation.POSITIONS, ablation.TORQUES, ablation.BOTH, ablation.ALL
FEATURES = {POSITIONS: [0.3] * 3, TORQUES: [0.5, 0.5, 0.2], BOTH: [0.1] * 3, ALL: [0.7, 0.7, 0.4]}


def ablated(**errors: Any) -> Outcomes:
    """Return errors by features, and of positions and torques with one more group."""

    def result(case: Case) -> Result:
        left = {**FEATURES, **errors}.get(case.arguments["features"], [0.1] * 3)
        shuffled = {model: {name: [0.2, 0.3, 0.4] for name in ablation.SHUFFLED} for model in ablation.MODELS}
        return {**dict.fromkeys(ablation.MODELS, left), "inputs": 16, "shuffled": shuffled}

    return all_of(ablation.cases(Scope(robots=(None, 1))), result)


ABLATION, T1, T2, T3, T4, T5 = "calibration-ablation", *(f"calibration-table-{n}" for n in (1, 2, 3, 4, 5))
F3, F5, F7, F8, F9 = (f"calibration-figure-{n}" for n in (3, 5, 7, 8, 9))
ROWS = [
    *SIX_HOURS,
    Row(F3, "the paper's paths", path, "rrrrrrr", ["J1"]),
    Row(F3, "recorded for twice as long", partial(path, 2.0), "rrrrrnn", ["11.0 to 37.8 min, of which recording 7.0 to 33.8"]),
    Row(F3, "other paths", other_path, "nnnnnnn"),
    # the paper's polynomial and linear model of joint 2 rank third and second
    Row(T1, "the paper's table", lambda: directions(dict(published.TABLE_1)), "rsrrr", ["0."], "yyyyy"),
    Row(T1, "a tie of network and linear model", table_1_ties, "n...."),
    Row(T1, "methods the other way round", table_1_turned, "n.nnn"),
    Row(T1, "J2-J3 has half the errors", table_1_halved, ".r..."),
    Row(F5, "the paper's errors", sparse, "rrrrrrrrrrr", ["±"], "yyyyyyyyyyy"),
    Row(F5, "errors that do not depend on the recording", partial(sparse, alike(0.3)), "nrnnnrnnnnr"),
    Row(F5, "a gain of the third digit", partial(sparse, alike(0.3, 1e-6)), "...n...n..."),
    Row(F5, "the network like the linear model", partial(sparse, lambda found: {NETWORK: found["linear"]}), "......n....",
        ["0 of 3, beside it 3 of 3"]),
    Row(F5, "every method gains by time, the offset least", partial(sparse, gaining), ".n...n....n"),
    Row(F8, "the paper's numbers", inputs, "rrrrrr", ["| 0.397 ± 0.000 | 0.397 ± 0.000 | 0.397",
        "network, 138 | 11 | 1", "larger network, 138, stamp | 6 | 1", "polynomial, 138 | 6 | -", "linear, 16 | 11 | -"], ".yyyyy"),
    Row(F8, "inputs that cost nothing", partial(inputs, 0.3, papers_sizes=False), "n.n.n."),
    Row(F8, "a larger network like the small one", partial(inputs, larger=published.INPUTS_138["network"]), "...n.."),
    Row(F8, "16 inputs are as bad, and the polynomial good", partial(inputs, few=10.0, polynomial=0.01), ".n...n"),
    Row(T2, "the paper's own table", end_to_end, "rrrrr", ["network | 0.328 ± 0.000 | 0.328 | 0.831 ± 0.000 | 0.831"]),
    Row(T2, "regressions are worse end to end", partial(end_to_end, regressions=2.0), "n...."),
    Row(T2, "a network as good end to end", partial(end_to_end, 0.2), ".n..."),
    Row(T2, "joint 3 is several times worse", partial(end_to_end, 0.5), ".s..."),
    Row(T2, "more epochs do not help", partial(end_to_end, last=0.97), "...nr"),  # on the error it has converged before
    Row(T2, "a network like the linear model", partial(end_to_end, network="linear"), "..n.."),
    Row(T2, "the error has not converged", partial(end_to_end, converged=2.0), "....n"),
    Row(F9, "the paper's errors", lambda: homings(RISING, [0.25, 0.3, 0.3, 0.35, 0.4, 0.41]), "rrrrrr", ["0.630"]),
    # that errors stay small with a homing seen holds where none does harm
    Row(F9, "homing does nothing", lambda: homings([0.25] * 6, [0.25] * 6), "rnnrrn"),
    Row(F9, "a rise of three per cent", lambda: homings([0.25] * 5 + [0.2575], [0.25] * 6), ".n...."),
    Row(F9, "the other joints lose more", lambda: homings(RISING, [0.25] * 6, others_by=3.0), "n...nn"),
    Row(F9, "a homing seen does not help", lambda: homings(RISING, [0.25, 0.5, 0.6, 0.8, 0.9, 1.2]), "..nn.."),
    Row(T3, "the paper's range", partial(papers_range, "errors"), "r.r."),
    Row(T3, "between", lambda: beside_peers(hours(3.0, 4.0), {UKF: hours(3.5, 4.5)}), "sns.",
        ["network, here | simulated RAVEN-II | 3.000–4.000 ± 0.000", f"{UKF}, here | simulated RAVEN-II | 3.500–4.500 ± 0.000",
         "50, 60, 70000", "on 2, 0, 0 of them joints 1, 2 and 3 end at the softest"]),
    Row(T3, "beyond the offset", lambda: beside_peers(hours(3.0, 5.5)), "n..."),
    Row(T3, "the filter is worse", lambda: beside_peers(hours(3.0, 4.0), {UKF: hours(4.3, 9.0)}), ".r.r"),
    Row(T3, "the linear model is the worst", lambda: beside_peers(hours(3.0, 4.0), {UKF: hours(4.3, 9.0)}, linear=hours(3.0, 8.0)), "..nn"),
    Row(T3, "a tie with the filter", lambda: beside_peers(hours(3.0, 4.0), {UKF: hours(4.1, 9.0)}), ".n.."),
    Row(T4, "the paper's range", partial(papers_range, "tip"), ".rr.."),
    Row(T4, "between", lambda: beside_peers(hours(3.0, 4.0)), "nss..", ["GPR, Mahler [42] | RAVEN-II | 1.4 | 1.4 | 1.1 | -"]),
    Row(T4, "beyond the offset", lambda: beside_peers(hours(3.0, 5.5)), ".n..."),
    Row(T4, "the process is worse in hour 0", lambda: beside_peers(hours(3.0, 9.0), {PROCESS: hours(3.5, 3.5)}), "...r."),
    Row(T4, "the process is better", lambda: beside_peers(hours(3.0, 9.0), {PROCESS: hours(2.5, 3.5)}), "...n."),
    # the linear model, from 1.0 mm, on one axis alone; z ties with the network of Peng
    Row(T4, "better than the network of Peng", lambda: beside_peers(hours(0.3, 9.0), raw=20.0), "r...s"),
    Row(T4, "both are better than it", lambda: beside_peers(hours(0.3, 9.0), linear=hours(0.3, 8.0)), "..n.r"),
    Row(T4, "ties on z", lambda: beside_peers(hours(0.51, 9.0)), "....n"),
    Row(T5, "the paper's aspects", partial(aspects, papers=True), "rrrrrrrrr"),
    Row(T5, "their contrary", partial(aspects, papers=False), "rnnnnnnnn"),  # the same errors are very close
    # 7 % in the mean, and on one robot less
    Row(T5, "a gain within the spread", partial(aspects, papers=True, gains=(0.3, 0.0, -0.1)), ".n......."),
    Row(T5, "far better", partial(aspects, papers=True, gains=(0.5, 0.5, 0.5)), "nr......."),
    Row(ABLATION, "the paper's conclusions", ablated, "rrr", ["2.00 ± 0.00"]),  # 0.2 of 0.1
    Row(ABLATION, "their contrary", lambda: ablated(**{BOTH: [0.8] * 3, POSITIONS: [0.5, 0.5, 0.1], TORQUES: [0.3] * 3}), "nnn"),
    Row(ABLATION, "joint 3 needs torques no more", lambda: ablated(**{TORQUES: [0.5, 0.5, 0.4]}), "..n"),
    Row(ABLATION, "torques add little", lambda: ablated(**{POSITIONS: [0.103, 0.103, 0.3]}), "n.."),
]  # fmt: skip
