"""Features of the calibration paper's models, left out and added: which group matters to which joint.

After the ablation study that chose the paper's inputs (its reference 44; II-C, II-H, III). Direction J2-J3 at 1/2 +
1/3 + 1/4 trains on the robot just homed, 20 minutes of random motion test. Network (mean of its trainings) and
linear model take positions alone, torques alone, both (the paper's 16 inputs), these and one more group of the
robot's state each, and all 138. They are asked everywhere, as the paper's are. Beside that, the models of 16 inputs
are tested with a signal's rows shuffled, so that it tells nothing: by how much a joint's error grows then is what the
model makes of the signal. The study's own numbers are not in the paper; its conclusions are.

That joint 3 decides the claim about joint 3 was added after a first run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from papers.calibration import recordings
from papers.calibration.inputs import ALL_138, SIXTEEN
from papers.calibration.judging import by_joint, less, statement
from papers.calibration.six_hours import joint_rmse, left_by
from papers.experiment import CLEARLY, Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import METHOD_COLORS, legend_below, panels
from papers.kit import IN_UNITS, JOINTS, by_count, cells, filled, graded, grid, mean_and_spread, rows, sample, table

# groups beside positions and torques, by the columns of the robot's state that they hold
FURTHER = {
    "joint velocities": ("jvel",),
    "motor positions": ("mpos",),
    "motor velocities": ("mvel",),
    "encoder values": ("encVals",),
    "encoder offsets": ("encoffsets",),
    "desired joint positions": ("jpos_d",),
    "desired motor positions": ("mpos_d",),
    "current commands": ("dac_val",),
    "pose": ("pos", "ori"),
    "desired pose": ("pos_d", "ori_d"),
    "Jacobian velocity": ("jac_vel",),
    "Jacobian force": ("jac_f",),
}
POSITIONS, TORQUES, BOTH, ALL = "positions", "torques", "positions and torques", "all 138"
FEATURES: Mapping[str, tuple[str, ...]] = {
    POSITIONS: ("q",),
    TORQUES: ("tau",),
    BOTH: SIXTEEN,
    **{
        f"+ {name}": (*SIXTEEN, *(each for each in ALL_138 if each.partition(":")[0] in columns))
        for name, columns in FURTHER.items()
    },
    ALL: ALL_138,
}
SHUFFLED = {
    f"{quantity} {joint}": f"{group}:{name}"
    for quantity, group in (("position", "q"), ("torque", "tau"))
    for joint, name in zip(JOINTS, ("shoulder", "elbow", "insertion"), strict=True)
}
MODELS = (recordings.NETWORK, "linear")
NO_HELP = 0.9  # of the error with 16 inputs: a group that leaves less than this is of importance


@run(revision=1)
def feature_errors(
    seed: int | None, features: str, networks: Sequence[int], sparsities: Sequence[float], test_seconds: float
) -> Result:
    """Train network and linear model on a choice of features, and test them.

    Returns:
        `inputs`, their number; by model RMSE on J1 [deg], J2 [deg], J3 [mm]; and, of positions and torques, by model
        and signal in `shuffled` the RMSE with that signal's rows shuffled.
    """
    columns = () if set(FEATURES[features]) <= set(SIXTEEN) else ("all",)
    plant, other = recordings.homed(seed), recordings.homed(seed, side="right") if columns else None
    train = recordings.calibration_log(
        plant, recordings.draws(seed, 70, 0), sparsities=sparsities, columns=columns, other=other
    )
    test = recordings.random_log(plant, recordings.draws(seed, 70, 1), test_seconds, columns=columns, other=other)
    content: dict[str, object] = {}
    shuffled: dict[str, dict[str, list[float]]] = {}
    for name in MODELS:
        options = replace(recordings.METHODS[name], inputs=FEATURES[features])
        seeds = networks if name == recordings.NETWORK else (0,)
        models = [recordings.fitted([train], replace(options, seed=each)) for each in seeds]
        content[name] = recordings.mean([errors_left(model, test) for model in models])
        content["inputs"] = len(models[0].features.names)
        if features == BOTH:
            shuffled[name] = {
                label: recordings.mean([errors_left(model, test, shuffle=signal) for model in models])
                for label, signal in SHUFFLED.items()
            }
    return content | {"shuffled": shuffled}


def errors_left(model: CalibrationModel, log: MotionLog, *, shuffle: str | None = None) -> list[float]:
    """Return a model's RMSE on J1 [deg], J2 [deg], J3 [mm], asked everywhere; a signal's rows shuffled first."""
    data = recordings.rows_of(model, log)
    if shuffle is not None:
        X = data.X.copy()
        column = model.features.names.index(shuffle)
        X[:, column] = np.random.default_rng(0).permutation(X[:, column])
        data = replace(data, X=X)
    return joint_rmse(left_by(recordings.unguarded(model), data))


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and choice of features."""
    quick = scope.quick
    return grid(
        feature_errors, {"seed": scope.robots, "features": (POSITIONS, BOTH) if quick else FEATURES},
        networks=scope.networks_of, sparsities=(1 / 2,) if quick else recordings.SPARSITIES,
        test_seconds=60.0 if quick else recordings.TEST_SECONDS,
    )  # fmt: skip


def of(o: Outcomes, features: str, model: str) -> Floats:
    """Return RMSE (robots, 3) of a model with a choice of features."""
    return sample(o, feature_errors, model, features=features)


def shuffled(o: Outcomes, signal: str, model: str) -> Floats:
    """Return by how many times errors grow (robots, 3) when a signal's rows are shuffled."""
    return sample(o, feature_errors, "shuffled", model, signal, features=BOTH) / of(o, BOTH, model)


def report(o: Outcomes) -> Report:
    """Return errors by features, what shuffling does, and a picture of the first."""

    def errors(name: str) -> list[str]:
        texts = [each for model in MODELS for each in cells(of(o, name, model))]
        return [name, f"{o.of(feature_errors, features=name)[0]['inputs']}", *texts]

    def grown(name: str) -> list[str]:
        return [name, *(each for model in MODELS for each in cells(shuffled(o, name, model), 2))]

    by_model = [f"{model} {joint}" for model in MODELS for joint in IN_UNITS]
    without_units = [f"{model} {joint}" for model in MODELS for joint in JOINTS]
    title = "Error of a joint, in times what it was, with a signal shuffled"
    tables = [
        table("RMSE by features", ["features", "inputs", *by_model], rows(errors, FEATURES)),
        table(title, ["shuffled", *without_units], rows(grown, SHUFFLED)),
    ]
    caption = "RMSE by features, mean over robots; lines are the paper's 16 inputs; bars may leave the picture"
    return Report(filled(tables), {caption: _picture(o)})


def _picture(o: Outcomes) -> Any:
    names = [name for name in FEATURES if o.of(feature_errors, features=name)]
    figure, axes = panels(3, 4.6, sharey=True)
    places = np.arange(len(names))
    for j, panel in enumerate(axes):
        for k, model in enumerate(MODELS):
            reached, color = np.array([of(o, name, model).mean(axis=0)[j] for name in names]), METHOD_COLORS[model]
            panel.barh(places + (k - 0.5) * 0.38, reached, 0.34, color=color, label=model)
            if BOTH in names:
                panel.axvline(reached[names.index(BOTH)], color=color, linewidth=1, linestyle=":")
            # what is ruined would leave the rest unreadable
            panel.set_xlim(0.0, 3.0 * float(np.median(reached)))
        panel.set_yticks(places, names, fontsize=8)
        panel.set_title(IN_UNITS[j], fontsize=10)
    axes[0].invert_yaxis()
    legend_below(figure, axes[0], columns=2)
    return figure


EXPERIMENT = Experiment(
    "calibration-ablation", "II-C, II-H, reference 44", "Features left out and added", __doc__,
    cases, report, minutes=29.0, drawn=2,
)  # fmt: skip


@EXPERIMENT.claim(
    "Joint positions and motor torques are important to the calibration",
    "II-C, II-H",
    "-",
    f"the network's error with both is less, {CLEARLY}, than with either alone, on every joint; same direction: than "
    "with positions alone on two joints, and than with torques alone on two",
    "a cable stretches by the torque that it carries, and what idlers and winding do depends on positions: without "
    "either, a joint errs by half as much again, or more",
)
def _both_needed(o: Outcomes) -> Judgement:
    both, positions, torques = (of(o, name, recordings.NETWORK) for name in (BOTH, POSITIONS, TORQUES))
    text = f"both, positions, torques: {by_joint(both, positions, torques)}"
    halves = less(both, torques), less(both, positions)  # what positions add, and what torques
    of_each = [f"{half.sum()} of {half.size}" for half in halves]
    text += f" (positions on {of_each[0]} joints, torques on {of_each[1]})"
    return graded(all(half.all() for half in halves), all(half.mean() > 0.5 for half in halves), text)


@EXPERIMENT.claim(
    "Nothing else in the robot's state is",
    "II-H",
    "-",
    f"with any further group, on any joint, the network's error is at least {NO_HELP} times that with both, mean over "
    "robots; same direction: for more than half",
    "no group makes any joint better by a tenth; velocities, which are others on a zig-zag than in random motion, make "
    "joint 2 worse",
)
def _nothing_else(o: Outcomes) -> Judgement:
    both = of(o, BOTH, recordings.NETWORK)
    ratios = {name: of(o, f"+ {name}", recordings.NETWORK) / both for name in FURTHER}
    texts = []
    for j, joint in enumerate(JOINTS):
        name = min(ratios, key=lambda each: float(ratios[each][:, j].mean()))
        texts.append(f"{joint} {mean_and_spread(ratios[name][:, j], 2)} with {name}")
    return by_count(
        [each >= NO_HELP for one in ratios.values() for each in one.mean(axis=0)], f"least: {', '.join(texts)}"
    )


@EXPERIMENT.claim(
    "Joint 3 is the only joint in which torques are more important than positions",
    "III",
    "-",
    f"on joint 3 the network's error with torques alone is less, {CLEARLY}, than with positions alone; beside it, on "
    "joints 1 and 2 that with positions is less; same direction cannot be without the former",
    "joint 3's error depends on positions, its own above all, more than on its torque (signals shuffled); on the "
    "nominal robot either alone tells as much",
)
def _torques_on_joint_3(o: Outcomes) -> Judgement:
    torques, positions = (of(o, name, recordings.NETWORK) for name in (TORQUES, POSITIONS))
    ratio = by_joint(torques / positions, digits=2)
    text = f"error with torques alone over that with positions alone: {ratio}"
    return statement(less(torques, positions)[2:], less(positions, torques)[:2], text)
