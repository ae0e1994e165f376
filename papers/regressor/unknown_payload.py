"""An unknown load anywhere and at any time: is it noticed, on which link is it, how heavy, and how sure may one be.

Seven-joint arms of the Panda's geometry with drawn masses learn their gravity in 20 to 40 poses at rest, by recursive
least squares that know their links may take something up, and forget nothing. Then a load of 0.1 to 2 kg hangs on any
link, within 0.12 m along each axis of its frame, or, every fourth time, none. Torques carry Gaussian noise of 0.1 Nm.
Three conditions: the estimator expects loads of the package's default size, 2 kg and 0.3 kg m; it is told how large
these loads are, 0.8 kg and 0.06 kg m (root mean squares); and the default with twice the noise that it is told. What
is believed is noted after 1, 2, 5, 10 and 20 poses. The estimator's settings were chosen on the nominal arm with
other loads and poses than these.

A statement is calibrated if, of all that were made with a probability of 70 %, 70 % are right; where fewer are, by more
than two standard errors of a share, it is overconfident, and a remark says so. What is judged here are statements of
this package, not of a paper. The first joint stands upright: no torque tells what its own link carries. Beyond
the gravity-regressor paper.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from catenary import RobotModel, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.gravity.estimator import RecursiveGravityEstimator
from catenary.gravity.load_location import LOAD_SIZE
from catenary.gravity.payload import Payload
from catenary.spatial import LEVEL
from papers.experiment import Case, Experiment, Judgement, Outcomes, Plain, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.kit import NOT_MEASURED, by_count, table
from papers.regressor.decomposition import with_bodies

GEOMETRY = "panda"  # seven turning joints; masses are drawn
LIGHTEST, HEAVIEST = 0.1, 2.0  # [kg]
FURTHEST = 0.12  # [m] of the load from the origin of its link's frame, along each axis
SIZES = (0.8, 0.06)  # [kg, kg m] root mean squares of these masses and moments
NOISE = 0.1  # [Nm] that the estimator is told
POSES_BEFORE = (20, 40)  # poses at rest before the load comes, at the least and at most
LOOKED_AT = (1, 2, 5, 10, 20)  # poses with the load, after which beliefs are noted
# noise over what is told, and whether the loads' sizes are
CONDITIONS = {
    (1.0, False): "default size of loads",
    (1.0, True): "told the loads' sizes",
    (2.0, False): "noise twice what is told",
}
USUAL = (1.0, False)
BINS = (0.0, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0)
MASSES = (0.1, 0.25, 0.5, 1.0, 2.0)
COLORS = ("#4b6b94", "#2f8f6b", "#d9622b")
NOTICED = 0.5  # probability of no load below which it counts as noticed
FEWEST = 5  # statements in a bin that is shown
HOLD = 0.95  # of lists of likely links, each said to hold that
HEADER = ("loads", "noticed", "right link", "among the likely", "likely links", "mass error, median [kg]", "in 2 sd")


def arm(seed: int | None) -> RobotModel:
    """Return an arm whose masses are drawn."""
    return with_bodies(load_robot(GEOMETRY), np.random.default_rng(100 if seed is None else seed))


def poses(model: RobotModel, count: int, rng: np.random.Generator) -> Floats:
    """Draw poses (count, n) in the middle 80 % of the joints' ranges."""
    middle, half = 0.5 * (model.lower + model.upper), 0.4 * (model.upper - model.lower)
    drawn: Floats = middle + half * rng.uniform(-1.0, 1.0, size=(count, model.n))
    return drawn


def trial(
    model: RobotModel, rng: np.random.Generator, noise: float, *, loaded: bool, load: tuple[float, float] = LOAD_SIZE
) -> Result:
    """Let an arm learn itself, take up a load, and go through more poses; return what was believed on the way.

    Torques have a noise [Nm]; `load` is what the estimator is told of loads: RMS of mass [kg] and moment [kg m].
    """
    link = int(rng.integers(len(model.link_names)))
    mass = float(np.exp(rng.uniform(np.log(LIGHTEST), np.log(HEAVIEST))))
    place = rng.uniform(-FURTHEST, FURTHEST, 3)
    name = model.link_names[link]
    carrying = Payload(mass, name, place).on(model) if loaded else model
    estimator = RecursiveGravityEstimator(
        model, noise=NOISE, settle=0.0, interval=0.0, novelty=0.0, forgetting=1.0, margin=-1.0,
        carriers=model.link_names, load=load,
    )  # fmt: skip
    before = int(rng.integers(*POSES_BEFORE, endpoint=True))
    q = poses(model, before + LOOKED_AT[-1], rng)
    gravity = np.concatenate([gravity_torque(model, q[:before], LEVEL), gravity_torque(carrying, q[before:], LEVEL)])
    tau = gravity + noise * rng.normal(size=q.shape)
    still = np.zeros(model.n)
    seen = []
    alarm = False
    for k in range(len(q)):
        estimator.update(q[k], still, tau[k], LEVEL, float(k))
        count = k - before + 1
        if count == 0:
            alarm = estimator.load is not None and estimator.load.no_load < 0.5
        if count in LOOKED_AT:
            beliefs = estimator.load
            if beliefs is None:
                seen.append({"poses": count, "no_load": 1.0})
                continue
            first = beliefs.carriers[0]
            there = next(one for one in beliefs.carriers if one.frame == name)
            share = first.probability / max(1.0 - beliefs.no_load, 1e-12)  # if there is a load
            seen.append(
                {
                    "poses": count,
                    "no_load": beliefs.no_load,
                    "right": first.frame == name,
                    "probability": share,
                    "likely": len(beliefs.likely),
                    "among_likely": name in beliefs.likely,
                    "mass_error_kg": first.mass - mass,
                    "mass_error_there_kg": there.mass - mass,
                    "mass_std_kg": first.mass_std,
                }
            )
    return {"link": link + 1 if loaded else 0, "mass_kg": mass if loaded else 0.0, "alarm": alarm, "seen": seen}


@run(revision=5)
def payload_trials(seed: int | None, noise_ratio: float, told_sizes: bool, trials: int) -> Result:
    """Try loads on an arm, every fourth time none.

    Args:
        noise_ratio: True noise over what the estimator is told.
        told_sizes: The estimator is told how large these loads are; else it takes what the package comes with.
    """
    model = arm(seed)
    load = SIZES if told_sizes else LOAD_SIZE
    # not the numbers on which the estimator's settings were chosen
    rng = np.random.default_rng([20261123, 0 if seed is None else seed + 1])
    return {
        "trials": [
            trial(model, rng, noise_ratio * NOISE, loaded=number % 4 != 3, load=load) for number in range(trials)
        ]
    }


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every arm and condition."""
    conditions, trials = ((USUAL,), 8) if scope.quick else (tuple(CONDITIONS), 120)
    return [
        payload_trials.case(seed=seed, noise_ratio=ratio, told_sizes=sizes, trials=trials)
        for seed in scope.robots
        for ratio, sizes in conditions
    ]


def trials_of(o: Outcomes, condition: tuple[float, bool]) -> list[Plain]:
    """Return all trials under a condition."""
    ratio, sizes = condition
    results = o.of(payload_trials, noise_ratio=ratio, told_sizes=sizes)
    return [one for result in results for one in result["trials"]]


def after(trials: Sequence[Plain], poses: int) -> list[tuple[Plain, Plain]]:
    """Return every loaded trial with what was believed after some poses."""
    return [(one, next(seen for seen in one["seen"] if seen["poses"] == poses)) for one in trials if one["link"] > 0]


def noticed(seen: Plain) -> bool:
    """Return whether the load counts as noticed."""
    return bool(seen["no_load"] < NOTICED)


def report(o: Outcomes) -> Report:
    """Return detection, links and masses by poses, by link and by mass, and how right stated probabilities are."""
    tables, remarks = [], []
    for condition, words in CONDITIONS.items():
        if trials := trials_of(o, condition):
            stated = [[f"{100 * p:.1f} %", f"{100 * right:.1f} %", str(n)] for p, right, n in reliability(trials)]
            tables += [
                table(f"By poses with the load, {words}", ["poses", *HEADER], _by_poses(trials)),
                table(
                    f"Stated probability against share of right ones, {words}",
                    "stated, mean | right | statements",
                    stated,
                ),
            ]
            remarks += overconfident(trials, words)
    if usual := trials_of(o, USUAL):
        ends = f"after {LOOKED_AT[-1]} poses, {CONDITIONS[USUAL]}"
        tables += [
            table(f"By link, {ends}", ["link", *HEADER], _by_link(usual)),
            table(f"By mass, {ends}", ["mass", *HEADER], _by_mass(usual)),
        ]
    caption = (
        "Left: stated probability of the likeliest link against how often it is right. Right: loads noticed, and on "
        "the right link, by poses"
    )
    return Report(tables, {caption: _picture(o)}, remarks)


def _percent(holds: Sequence[bool]) -> str:
    return f"{100.0 * np.mean(holds):.0f} %" if len(holds) else "-"


def _row(name: str, pairs: Sequence[tuple[Plain, Plain]]) -> list[str]:
    seen_loads = [(one, seen) for one, seen in pairs if noticed(seen)]
    errors = [abs(seen["mass_error_kg"]) for _, seen in seen_loads if seen["right"]]
    spread = [abs(seen["mass_error_kg"]) <= 2.0 * seen["mass_std_kg"] for _, seen in seen_loads if seen["right"]]
    return [
        name,
        str(len(pairs)),
        _percent([noticed(seen) for _, seen in pairs]),
        _percent([seen["right"] for _, seen in seen_loads]),
        _percent([seen["among_likely"] for _, seen in seen_loads]),
        f"{np.mean([seen['likely'] for _, seen in seen_loads]):.1f}" if seen_loads else "-",
        f"{np.median(errors):.3f}" if errors else "-",
        _percent(spread),
    ]


def _by_poses(trials: Sequence[Plain]) -> list[list[str]]:
    alarms = [one["alarm"] for one in trials] + [noticed(one["seen"][-1]) for one in trials if one["link"] == 0]
    return [
        *(_row(str(poses), after(trials, poses)) for poses in LOOKED_AT),
        ["false alarms", str(len(alarms)), _percent(alarms), *["-"] * (len(HEADER) - 2)],
    ]


def _by_link(trials: Sequence[Plain]) -> list[list[str]]:
    pairs = after(trials, LOOKED_AT[-1])
    links = sorted({one["link"] for one, _ in pairs})
    return [_row(str(k), [pair for pair in pairs if pair[0]["link"] == k]) for k in links]


def _by_mass(trials: Sequence[Plain]) -> list[list[str]]:
    pairs = after(trials, LOOKED_AT[-1])
    return [
        _row(f"{low:g} to {high:g} kg", [pair for pair in pairs if low <= pair[0]["mass_kg"] < high])
        for low, high in pairwise(MASSES)
    ]


def statements(trials: Sequence[Plain]) -> list[Plain]:
    """Return what was believed whenever a load that is there was noticed."""
    return [seen for one in trials if one["link"] > 0 for seen in one["seen"] if noticed(seen)]


def reliability(trials: Sequence[Plain]) -> list[tuple[float, float, int]]:
    """Return mean stated probability, share of right ones and count, by bins of the probability."""
    stated = [(seen["probability"], seen["right"]) for seen in statements(trials)]
    bins = []
    for low, high in pairwise(BINS):
        chosen = [each for each in stated if low < each[0] <= high or (high == 1.0 and each[0] > 1.0)]
        if len(chosen) >= FEWEST:
            mean = [float(np.mean([each[k] for each in chosen])) for k in (0, 1)]
            bins.append((mean[0], mean[1], len(chosen)))
    return bins


def overconfident(trials: Sequence[Plain], words: str) -> list[str]:
    """Say where fewer statements are right than was stated, by more than two standard errors of a share."""
    return [
        f"Overconfident, {words}: stated {100 * p:.1f} % on average, right {100 * right:.1f} % of {count}."
        for p, right, count in reliability(trials)
        if not as_stated(p, right, count)
    ]


def as_stated(stated: float, right: float, count: int) -> bool:
    """Return whether a share of right statements is not below what was stated, within two standard errors of it."""
    return stated - right <= 2.0 * float(np.sqrt(stated * (1.0 - stated) / count))


def _picture(o: Outcomes) -> Any:
    figure, (left, right) = panels(2, 3.8)
    left.plot([0, 100], [0, 100], color="#b8bfc9", linewidth=1.0)
    for (condition, words), color in zip(CONDITIONS.items(), COLORS, strict=True):
        trials = trials_of(o, condition)
        if not trials:
            continue
        points = np.array(reliability(trials)).reshape(-1, 3)
        left.plot(100 * points[:, 0], 100 * points[:, 1], "o-", color=color, label=words)
        shares: dict[str, list[float]] = {"noticed": [], "on the right link": []}
        for poses in LOOKED_AT:
            pairs = after(trials, poses)
            shares["noticed"].append(100 * float(np.mean([noticed(seen) for _, seen in pairs])))
            shares["on the right link"].append(
                100 * float(np.mean([noticed(seen) and seen["right"] for _, seen in pairs]))
            )
        for (name, values), style in zip(shares.items(), ("o--", "o-"), strict=True):
            right.plot(LOOKED_AT, values, style, color=color, label=f"{name}, {words}")
    left.set_xlabel("stated probability [%]")
    left.set_ylabel("right [%]")
    right.set_xlabel("poses with the load")
    right.set_ylabel("share of loads [%]")
    right.set_xticks(LOOKED_AT)
    right.set_ylim(0, 100)
    left.legend(frameon=False, fontsize=8, loc="upper left")
    legend_below(figure, right, columns=3)
    return figure


EXPERIMENT = Experiment(
    "regressor-payload", "beyond the gravity-regressor paper", "An unknown load on any link, at any time", __doc__,
    cases, report, of="beyond", minutes=2.0,
)  # fmt: skip


@EXPERIMENT.claim(
    "A stated probability of a link can be believed",
    "beyond the paper",
    "as stated",
    "in every bin of stated probabilities the share of right ones is not below the stated mean by more than two "
    "standard errors of a share, all arms and poses together, with the default size of loads; same direction: in more "
    "than half of the bins",
    "statements on one load after one, two, five ... poses go together, so that the standard errors are rather larger",
)
def _sure(o: Outcomes) -> Judgement:
    bins = reliability(trials_of(o, USUAL))
    text = ", ".join(f"{100 * p:.1f} % right {100 * right:.1f} %" for p, right, _ in bins)
    return by_count([as_stated(*one) for one in bins], f"stated {text}")


@EXPERIMENT.claim(
    "The link that carries the load is among the likely ones",
    "beyond the paper",
    "stated 95 %",
    "in 95 % of the lists within two standard errors of a share, all arms and poses together, with the default size of "
    "loads",
)
def _listed(o: Outcomes) -> Judgement:
    listed = statements(trials_of(o, USUAL))
    if len(listed) < FEWEST:
        return NOT_MEASURED
    share = float(np.mean([one["among_likely"] for one in listed]))
    return by_count([as_stated(HOLD, share, len(listed))], f"in {100 * share:.1f} % of {len(listed)} lists")
