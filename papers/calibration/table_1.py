"""Table I of the calibration paper: seven directions of zig-zags, three joints, five methods.

Each direction's zig-zags at 1/2, 1/3 and 1/4 train every model; an independent 20 minutes of random motion test it.
Each direction starts from the robot just homed: the paper's came one after another on a robot that
wears. The paper's network is the mean of its trainings; ours is trained once. The paper's models are asked
wherever the robot goes, as there; ours leaves joints at the fixed offset outside its valid range, as it ships.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.simulation.cable_parameters import RAVEN2, RAVEN2_ECCENTRIC, CableArm, load_cable_arm
from catenary.trajectories.zigzag import DIRECTIONS, Direction
from papers.calibration import authors, recordings
from papers.calibration.judging import by_joint, less
from papers.calibration.published import TABLE_1
from papers.experiment import (
    CLEARLY,
    NOMINAL,
    Case,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Result,
    Robot,
    Scope,
    TitledTable,
    run,
)
from papers.figures import METHOD_COLORS, legend_below, panels
from papers.kit import IN_UNITS, JOINTS, by_count, filled, grid, joint_tables, rows, sample, table
from papers.plant.targets import fitted_to

MODELS = (recordings.NETWORK, "polynomial", "linear")
PAPERS = (*MODELS, "fixed offset", "raw")
PAPERS_CHOICE: Direction = "J2-J3"
SHOWN = (recordings.LEARNER, *PAPERS)
BEST_TWO = 2  # directions of each joint and model that the paper marks bold
OF_VARIANT = (NOMINAL, 1, 2, 3, 4, 5)  # robots whose encoders are off their centres
ECCENTRICITIES = (0.04, 0.06, 0.08, 0.1)
# shares of the fixed offset's error: what the network removes, and what any of nine entries
MOST_REMOVED, LEAST_REMOVED = 0.76, 0.649


@run(revision=2)
def direction_errors(
    seed: Robot,
    direction: Direction,
    networks: Sequence[int],
    sparsities: Sequence[float],
    test_seconds: float,
    arm: str = RAVEN2,
) -> Result:
    """Train every method along one direction and test it; return its RMSE on J1 [deg], J2 [deg], J3 [mm]."""
    return _errors(_recorded(seed, direction, sparsities, test_seconds, load_cable_arm(arm)), networks)


@run(revision=1)
def eccentric_errors(seed: int | None, eccentricity: float, turned: bool, networks: Sequence[int], arm: str) -> Result:
    """Return the same along J2-J3, where both encoders are off their centres by a share of the couplings' radius.

    In the variant's phases, or turned to any that the robot's seed draws.
    """
    variant = load_cable_arm(arm)
    rig = variant.rig.replace(eccentricity=eccentricity * (variant.rig.eccentricity > 0.0))
    if turned:
        rig = rig.replace(eccentric_phase=recordings.draws(seed, 9).uniform(-np.pi, np.pi, len(JOINTS)))
    turned_arm = variant._replace(rig=rig)
    return _errors(_recorded(seed, PAPERS_CHOICE, recordings.SPARSITIES, recordings.TEST_SECONDS, turned_arm), networks)


def _errors(recorded: tuple[list[MotionLog], MotionLog], networks: Sequence[int]) -> dict[str, list[float]]:
    train, test = recorded
    reached: dict[str, list[float]] = {}
    for name, options in recordings.METHODS.items():
        seeds = {recordings.NETWORK: networks, recordings.LEARNER: networks[:1]}.get(name, (0,))
        models = [recordings.fitted(train, replace(options, seed=network)) for network in seeds]
        used = models if name == recordings.LEARNER else [recordings.unguarded(model) for model in models]
        reached[name] = recordings.mean([recordings.rmse(model, recordings.rows_of(model, test)) for model in used])
        if name == "linear":
            reached |= recordings.baselines(models[0], recordings.rows_of(models[0], test))
    return reached


def _recorded(
    seed: Robot, direction: Direction, sparsities: Sequence[float], test_seconds: float, arm: CableArm
) -> tuple[list[MotionLog], MotionLog]:
    """Return zig-zags of a direction and the motion that tests it."""
    if isinstance(seed, str):
        folder, test = authors.tested(seed, direction)
        return [
            authors.read(paths[0]) for n, paths in folder.of(direction).items() if 1 / n in sparsities
        ], authors.read(test)
    plant, number = recordings.homed(seed, arm=arm), DIRECTIONS.index(direction)
    train = recordings.calibration_log(plant, recordings.draws(seed, number, 0), direction, sparsities)
    return [train], recordings.random_log(plant, recordings.draws(seed, number, 1), test_seconds)


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and direction; of the variant, and of other eccentricities along J2-J3."""
    sparsities, seconds = ((1 / 2,), 120.0) if scope.quick else (recordings.SPARSITIES, recordings.TEST_SECONDS)
    directions = (PAPERS_CHOICE,) if scope.quick else DIRECTIONS
    fixed = {"networks": scope.networks_of, "sparsities": sparsities, "test_seconds": seconds}
    made = grid(direction_errors, {"seed": scope.robots, "direction": directions}, **fixed)
    if not scope.quick:
        made += grid(
            direction_errors, {"seed": scope.robots, "direction": directions}, **fixed, arm=RAVEN2_ECCENTRIC
        ) + grid(
            eccentric_errors, {"seed": OF_VARIANT, "eccentricity": ECCENTRICITIES}, turned=False,
            networks=scope.networks_of, arm=RAVEN2_ECCENTRIC,
        ) + grid(
            eccentric_errors, {"seed": OF_VARIANT}, eccentricity=ECCENTRICITIES[-1], turned=True,
            networks=scope.networks_of, arm=RAVEN2_ECCENTRIC,
        )  # fmt: skip
    return made


def errors(o: Outcomes, direction: str, method: str) -> Floats:
    """Return the RMSE of a method along a direction, (robots, 3)."""
    return sample(o, direction_errors, method, direction=direction)


def report(o: Outcomes) -> Report:
    """Return the paper's table for each joint, the nominal robot beside the mean of all and the paper's."""
    header = ["direction"]
    for method in SHOWN:
        header += [method, f"{method}, paper"] if method in PAPERS else [method]

    def content(j: int) -> list[list[str]]:
        def row(direction: str) -> list[str]:
            texts = [direction]
            for method in SHOWN:
                texts.append(f"{errors(o, direction, method)[:, j]}")
                texts += [f"{TABLE_1[direction][method][j]:.3f}"] if method in PAPERS else []
            return texts

        return rows(row, DIRECTIONS)

    tables = [*joint_tables("{}, RMSE", header, content), *filled([_by_eccentricity(o.variant or o)])]
    return Report(tables, {"RMSE by direction; lines are the paper's": _picture(o)})


def _by_eccentricity(o: Outcomes) -> TitledTable:
    """Return what is left along J2-J3 by how far encoders are off their centres, of the variant's robots."""

    def row(share: float, turned: bool) -> list[Any]:
        of = {each: sample(o, eccentric_errors, each, eccentricity=share, turned=turned) for each in PAPERS[:-1]}
        steps = [less(of["linear"], of["fixed offset"]), less(of[recordings.NETWORK], of["linear"])]
        in_order = [joint for joint, holds in zip(JOINTS, np.logical_and(*steps), strict=True) if holds]
        better = less(of["polynomial"], of["linear"])[0]
        phase = "drawn" if turned else "middle"
        return [share, phase, *of.values(), ", ".join(in_order) or "none", "yes" if better else "no"]

    header = ["e/r", "phase", *PAPERS[:-1], "offset > linear > network on", "polynomial < linear on J1"]
    return table(
        "Encoders of J1 and J2 off their centres, direction J2-J3, RMSE",
        header,
        rows(row, ECCENTRICITIES, (False, True)),
    )


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.0)
    directions = [each for each in DIRECTIONS if o.of(direction_errors, direction=each)]
    places = np.arange(len(directions))
    for j, panel in enumerate(axes):
        for k, method in enumerate((*MODELS, recordings.LEARNER)):
            reached = np.array([errors(o, direction, method)[:, j] for direction in directions])
            at = places + (k - 1.5) * 0.2
            panel.bar(at, reached.mean(axis=1), 0.18, color=METHOD_COLORS[method], label=method)
            if method in PAPERS:
                published = [TABLE_1[direction][method][j] for direction in directions]
                panel.hlines(published, at - 0.1, at + 0.1, color="black", linewidth=1.2)
        panel.set_xticks(places, directions, rotation=60, fontsize=8)
        panel.set_title(IN_UNITS[j], fontsize=10)
    legend_below(figure, axes[0], columns=4)
    return figure


def removed(o: Outcomes, method: str) -> Floats:
    """Return the share of the fixed offset's error that a model removes in direction J2-J3, (robots, 3)."""
    error, offset = (errors(o, PAPERS_CHOICE, each) for each in (method, "fixed offset"))
    return 1.0 - error / offset


def _share_removed(o: Outcomes, methods: Sequence[str], share: float) -> Judgement:
    shares = {method: removed(o, method) for method in methods}
    text = "; ".join(f"{method} {by_joint(100.0 * each, digits=0, unit=' %')}" for method, each in shares.items())
    # to a per cent: the paper's own shares do not follow from its rounded errors more closely
    return by_count([each >= share for one in shares.values() for each in np.round(one.mean(axis=0), 2)], text)


FITTED_PART = "the linear model's and the fixed offset's errors are among what the simulated robot was fitted to"
EXPERIMENT = Experiment(
    "calibration-table-1", "table I", "Calibration error by direction of the zig-zags", __doc__,
    cases, report, minutes=41.0, drawn=2,
)  # fmt: skip


@EXPERIMENT.claim(
    "Offset > linear > network on every joint, direction J2-J3",
    "II-E, table I",
    "0.859 > 0.174 > 0.104 deg; 1.095 > 0.186 > 0.120 deg; 0.492 > 0.166 > 0.118 mm",
    f"each less than the one before, {CLEARLY}, on all three joints; same direction: on two. The first step is no "
    f"test: {FITTED_PART}",
    "on joints 1 and 2 the network gains less on the linear model than robots differ by: what both leave is mostly "
    "memory of friction, which no model without memory learns (the learner, with one, errs by 0.096 deg on joint 2). "
    "On joint 3 it learns the idlers' run-out. An encoder off its centre errs smoothly: a network learns that, and a "
    "line does not: at e/r 0.1 the paper's order holds on all joints, at 0.08 on joints 1 and 3",
)
def _order(o: Outcomes) -> Judgement:
    offset, linear, network = (
        errors(o, PAPERS_CHOICE, each) for each in ("fixed offset", "linear", recordings.NETWORK)
    )
    holds = less(linear, offset) & less(network, linear)
    return by_count(holds, f"fixed offset, linear, network: {by_joint(offset, linear, network)}")


@EXPERIMENT.claim(
    "J2-J3 is among the two best directions",
    "II-E, table I",
    "eight of nine joints and models",
    "J2-J3 ranks first or second of seven, mean over robots, for every joint and model; same direction: for more than "
    "half",
    "J1-J2 and J1-J2-J3 turn joint 2 back as often as J2-J3 (50 times) and move joint 1 as well, to which its cable is "
    "coupled: network and linear model learn joint 2 better from them",
)
def _best_direction(o: Outcomes) -> Judgement:
    ranks, texts = [], []
    for method in MODELS:
        of_method = []
        for j, joint in enumerate(JOINTS):
            means = {each: float(errors(o, each, method)[:, j].mean()) for each in DIRECTIONS}
            order = sorted(means, key=means.__getitem__)
            ranks.append(order.index(PAPERS_CHOICE) < BEST_TWO)
            over = errors(o, PAPERS_CHOICE, method)[:, j] / errors(o, order[0], method)[:, j]
            of_method.append(f"{joint} {order.index(PAPERS_CHOICE) + 1} (times {over:.2f})")
        texts.append(f"{method} {', '.join(of_method)}")
    return by_count(ranks, "rank of J2-J3, and its error in times the best direction's: " + "; ".join(texts))


@EXPERIMENT.claim(
    "Beyond the fixed offset the network removes more than 76 % of the error",
    "abstract, II-E",
    "87.9 %, 89.1 %, 76.0 %",
    "at least 76 % on all three joints, mean over robots; same direction: on two",
)
def _network_removes(o: Outcomes) -> Judgement:
    return _share_removed(o, (recordings.NETWORK,), MOST_REMOVED)


@EXPERIMENT.claim(
    "With direction J2-J3 all three models remove more than 64.9 % on all three joints",
    "II-E, table I",
    "64.9 % to 89.1 %",
    "at least 64.9 % in all nine entries, mean over robots; same direction: in more than half. Six of them, the linear "
    "model's and the polynomial's, are no test",
    "the polynomial has most to learn: on joint 3 its error falls with recording time (figure 5), and has not come "
    "down to the others' after 1/2 + 1/3 + 1/4",
    fitted=any(fitted_to(method, "table I") for method in MODELS),
)
def _all_remove(o: Outcomes) -> Judgement:
    return _share_removed(o, MODELS, LEAST_REMOVED)


@EXPERIMENT.claim(
    "Joint 3 improves least on the fixed offset, for network and linear model",
    "III",
    "network 76.0 % against 87.9 and 89.1 %, linear 66.3 % against 79.8 and 83.0 %",
    f"share removed on joint 3 less than on joints 1 and 2, {CLEARLY}, for both; same direction: in more than half of "
    f"the four. The linear model's two are no test: {FITTED_PART}",
)
def _joint_3_least(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for method in (recordings.NETWORK, "linear"):
        shares = removed(o, method)
        holds += [bool(less(shares[:, 2], shares[:, j])) for j in (0, 1)]
        texts.append(f"{method} {by_joint(100.0 * shares, digits=0, unit=' %')}")
    return by_count(holds, "; ".join(texts))


@EXPERIMENT.claim(
    "On joint 1 the polynomial is better than the linear model in every direction",
    "table I",
    "; ".join(f"{each} {TABLE_1[each]['polynomial'][0]} < {TABLE_1[each]['linear'][0]}" for each in DIRECTIONS)
    + " deg",
    f"its error less than the linear model's, {CLEARLY}, in all seven; same direction: in more than half",
    fitted=fitted_to("polynomial", "table I"),
)
def _polynomial_on_joint_1(o: Outcomes) -> Judgement:
    pairs = {each: [errors(o, each, m)[:, 0] for m in ("polynomial", "linear")] for each in DIRECTIONS}
    text = "; ".join(f"{each} {polynomial} against {linear}" for each, (polynomial, linear) in pairs.items())
    return by_count([bool(less(polynomial, linear)) for polynomial, linear in pairs.values()], text)
