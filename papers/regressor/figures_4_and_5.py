"""Figure 4 of the gravity-regressor paper: an upper body of 19 joints under PD control, without any compensation.

tau = Kp (q_d - q) - Kd qd on the paper's timeline at 1 kHz, simulated in MuJoCo; the error of each joint of trunk,
left arm and right arm. The damping as printed holds a moving arm back, so errors on the way are mostly lag; beside it
ours, Kd (qd_d - qd). Poses, gains and rotors are ours where the paper states none: papers/regressor/dual_arm.py. The
paper has one robot; the spread is over robots whose masses differ by up to 30 % and centres of mass by up to 20 %.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Scope, TitledTable
from papers.figures import legend_below, panels
from papers.kit import Missing, by_count, by_robot, filled, rows, table
from papers.regressor.dual_arm import ALONE, KP, LIMBS, PICK_UP, SAMPLE, WINDOWS, dual_arm
from papers.regressor.published import ESTIMATION

OF_FIGURE_5 = """Figure 5 of the gravity-regressor paper: 19 joints learn their gravity while they are controlled.

tau = Kp (q_d - q) - Kd qd + Z s_hat on the paper's timeline at 1 kHz, simulated in MuJoCo. As printed: the law runs
from 7 to 12 s and holds what it knows after; on the compact or the full Z (the paper does not say which it ran), from
s_0 = 0 as the paper assumes, and from wrong parameters: masses 0.5 to 2 times and centres of mass 0.5 to 1.5 times
the true ones. "Longer": the same law from 7 s to the end of the motion. "Moving": the same law from 12 to 17 s, as long
as the estimation at rest, while the robot homes. The PD term at rest in poses one and two is the gravity that estimates
lack there.

Beside it ours, damping Kd (qd_d - qd): the law all the time, holding still by itself while the arm moves, and
recursive least squares on torques at rest. Beyond the paper: the right hand takes up 2 kg at 21 s, unknown to all;
the least squares know that a hand may.

Poses, gains and rotors are ours where the paper states none: papers/regressor/dual_arm.py. The paper has one robot; the
spread is over robots whose masses differ by up to 30 % and centres of mass by up to 20 %.
"""
BEFORE, LEARNT = "before estimation", "estimation, last second"
RESTS = ("rest in pose one", "rest in pose two")
AFTER = "all after estimation"
LABELS = {
    "pd": "PD alone",
    "law": "the paper's law, all the time",
    "rls": "least squares",
    "printed-pd": "PD alone",
    "printed-compact": "law on the compact Z",
    "printed-full": "law on the full Z",
    "printed-longer": "law on the compact Z, estimation from 7 s to the end",
    "printed-moving": "law on the compact Z, estimation while it moves, 12 to 17 s",
}
QUICK_PACE = 8.0
STAYS = 0.9  # of the error, through what would be the estimation
HALF, TENTH = 0.5, 0.1
LIMB_WORDS = ", ".join(LIMBS)


@dataclass(frozen=True)
class Condition:
    """One row of the tables: what runs on every robot."""

    controller: str
    start: str = "zero"
    payload_kg: float = 0.0

    @property
    def label(self) -> str:
        """The condition in words."""
        if self.controller in ALONE:
            return LABELS[self.controller]
        return f"{LABELS[self.controller]}, from {'zero' if self.start == 'zero' else 'wrong parameters'}"

    @property
    def reference(self) -> "Condition":
        """PD alone with the same damping under the same load."""
        alone = "printed-pd" if self.controller.startswith("printed") else "pd"
        return Condition(alone, payload_kg=self.payload_kg)


PRINTED, DAMPED = Condition("printed-pd"), Condition("pd")
COMPACT, FULL, LONGER, MOVING = (Condition(f"printed-{word}") for word in ("compact", "full", "longer", "moving"))
LAW, LEAST_SQUARES = Condition("law"), Condition("rls")
AS_PRINTED = (
    PRINTED,
    COMPACT,
    FULL,
    Condition("printed-compact", "wrong"),
    Condition("printed-full", "wrong"),
    LONGER,
    MOVING,
)
OURS = (DAMPED, LAW, Condition("law", "wrong"), LEAST_SQUARES, Condition("rls", "wrong"))
LOADED = tuple(Condition(name, payload_kg=2.0) for name in ("pd", "law", "rls"))


def cases_of(conditions: Sequence[Condition], scope: Scope) -> list[Case]:
    """Return a case for every robot and condition; quick ones move eight times as fast."""
    pace = QUICK_PACE if scope.quick else 1.0
    return [dual_arm.case(seed=seed, pace=pace, **vars(each)) for seed in scope.robots for each in conditions]


def rms(o: Outcomes, condition: Condition, window: str) -> Floats:
    """Return the RMS errors (robots, 3) of trunk, left and right arm [deg]."""
    return by_robot([[one["rms_deg"][window][limb] for limb in LIMBS] for one in _results(o, condition)])


def _results(o: Outcomes, condition: Condition) -> list[Any]:
    if results := o.of(dual_arm, **vars(condition)):
        return list(results)
    raise Missing(condition.label)


def force_left(o: Outcomes, condition: Condition, window: str) -> Floats:
    """Return the RMS of the PD term at rest (robots, 3) of trunk, left and right arm [Nm]: what gravity is unknown."""
    begin, end = (round(time / SAMPLE) for time in WINDOWS[window])
    errors = np.array([np.array(one["errors_deg"])[:, begin:end] for one in _results(o, condition)])
    squares = np.mean((KP[:, None] * np.deg2rad(errors)) ** 2, axis=2)  # (robots, 19)
    return by_robot(np.sqrt([[each[joints].mean() for joints in LIMBS.values()] for each in squares]))


def of_limbs(o: Outcomes, condition: Condition, window: str) -> Floats:
    """Return the mean of the limbs' errors, robot by robot [deg]."""
    return by_robot(rms(o, condition, window).mean(axis=1))


def share(o: Outcomes, condition: Condition, window: str) -> float:
    """Return the largest share of PD alone's error that a limb keeps, mean over robots."""
    return float(_over_alone(o, condition, window).mean(axis=0).max())


def _over_alone(o: Outcomes, condition: Condition, window: str) -> Floats:
    own, alone = (rms(o, each, window) for each in (condition, condition.reference))
    if len(own) != len(alone):
        raise Missing(condition.label)
    return own / alone


def window_table(o: Outcomes, title: str, conditions: Sequence[Condition]) -> TitledTable:
    """Return RMS errors by limb and window, mean and spread over robots."""

    def row(condition: Condition, limb: str) -> list[str]:
        k = list(LIMBS).index(limb)
        return [condition.label, limb, *(f"{rms(o, condition, window)[:, k]}" for window in WINDOWS)]

    spans = [f"{window}, {begin:g}-{end:g} s" for window, (begin, end) in WINDOWS.items()]
    return table(title, ["controller", "limb", *spans], rows(row, conditions, LIMBS))


def share_table(o: Outcomes, title: str, conditions: Sequence[Condition]) -> TitledTable:
    """Return what part of PD alone's error the worst limb keeps, by window."""
    windows = list(WINDOWS)[1:]

    def row(condition: Condition) -> list[str]:
        return [condition.label, *(f"{100.0 * share(o, condition, window):.1f} %" for window in windows)]

    learning = [each for each in conditions if each.controller not in ALONE]
    return table(title, ["controller", *windows], rows(row, learning))


def errors_picture(o: Outcomes, conditions: Sequence[Condition]) -> Any:
    """Draw the error of each joint over time of the first robot, a row of trunk, left and right arm per condition."""
    figure, axes = panels(3, 2.3 * len(conditions) + 0.3, rows=len(conditions), sharex=True)
    for row, condition in enumerate(conditions):
        errors = np.array(_results(o, condition)[0]["errors_deg"])
        time = SAMPLE * np.arange(errors.shape[1])
        for panel, (limb, joints) in zip(axes[3 * row : 3 * row + 3], LIMBS.items(), strict=True):
            for joint in range(joints.start, joints.stop):
                panel.plot(time, errors[joint], linewidth=0.9, label=f"joint {joint - joints.start + 1}")
            panel.axvspan(*ESTIMATION, color="#e8edf3", zorder=0)
            if condition.payload_kg > 0.0:
                panel.axvline(PICK_UP, color="#1c2430", linewidth=0.8, linestyle=":")
            panel.set_title(limb if row == 0 else "", fontsize=10)
        axes[3 * row].set_ylabel(f"{condition.label}\nerror [deg]", fontsize=8)
        level = max(float(np.abs(errors).max()), 1e-3)
        for panel in axes[3 * row : 3 * row + 3]:
            panel.set_ylim(-1.05 * level, 1.05 * level)
    for panel in axes[-3:]:
        panel.set_xlabel("time [s]")
    legend_below(figure, axes[1], columns=8)
    return figure


def cases_4(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot and kind of damping."""
    return cases_of((PRINTED,) if scope.quick else (PRINTED, DAMPED), scope)


def report_4(o: Outcomes) -> Report:
    """Return errors by limb and window, and the paper's picture."""
    tables = [
        window_table(o, "RMS error [deg], damping as printed", (PRINTED,)),
        window_table(o, "RMS error [deg], the velocity's error damped in its place", (DAMPED,)),
    ]
    caption = "Error of each joint under PD alone; shaded: 7 to 12 s"
    return Report(filled(tables), {caption: errors_picture(o, (PRINTED,))})


FIGURE_4 = Experiment(
    "regressor-figure-4", "figure 4", "19 joints under PD alone", __doc__, cases_4, report_4, minutes=2.0
)


@FIGURE_4.claim(
    "Without estimation the position error stays between 7 and 12 s",
    "figure 4, III-B",
    "a picture, no numbers",
    "in every limb the error of the last second is at least 90 % of that before 7 s, mean over robots",
)
def _stays(o: Outcomes) -> Judgement:
    begin, end = (rms(o, PRINTED, window) for window in (BEFORE, LEARNT))
    ends = zip(LIMBS, begin.T, end.T, strict=True)
    text = ", ".join(f"{limb} {first:.2f} to {last:.2f} deg" for limb, first, last in ends)
    return by_count(end.mean(axis=0) / begin.mean(axis=0) >= STAYS, text)


@FIGURE_4.claim(
    "With huge gains PD alone looks quite nice",
    "III-B",
    '"quite nice", no numbers',
    "less than 1 deg RMS of every limb at rest in the pose of estimation, on every robot",
    "The gains are ours: the paper states none. They were set so that PD alone sags by some tenths of a degree, so "
    "this says that our gains are of the kind that the paper means, and no more.",
)
def _small(o: Outcomes) -> Judgement:
    worst = rms(o, PRINTED, LEARNT).max(axis=1)  # limb of each robot
    return by_count(
        [float(worst.max()) < 1.0], f"worst limb at rest {worst:.2f} deg RMS, at most {worst.max():.2f} deg"
    )


def cases_5(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot and controller."""
    return cases_of((PRINTED, COMPACT, MOVING) if scope.quick else (*AS_PRINTED, *OURS, *LOADED), scope)


def report_5(o: Outcomes) -> Report:
    """Return errors by limb and window, what part of PD alone's they are, and the paper's picture."""
    tables, pictures, remarks = [], {}, []
    for title, conditions, drawn in (
        ("As the paper ran it", AS_PRINTED, (COMPACT, FULL)),
        ("Ours", OURS, (LAW, LEAST_SQUARES)),
        ("With 2 kg from 21 s, ours", LOADED, LOADED),
    ):
        if there := [each for each in drawn if o.of(dual_arm, **vars(each))]:
            tables.append(window_table(o, f"{title}: RMS error [deg]", conditions))
            tables.append(share_table(o, f"{title}: of PD alone, worst limb", conditions))
            pictures[f"{title}: error of each joint; shaded: 7 to 12 s"] = errors_picture(o, there)
            remarks.append(_tenth(o, title, conditions))
    return Report(filled(tables), pictures, remarks)


def _tenth(o: Outcomes, title: str, conditions: Sequence[Condition]) -> str:
    """Say which controllers brought the error of every limb to a tenth of PD alone's."""
    loaded = conditions[0].payload_kg > 0.0
    window = RESTS[1] if loaded else AFTER

    def row(condition: Condition) -> list[str]:
        reached = "reached" if share(o, condition, window) <= TENTH else "not reached"
        return [f"{condition.label}: {reached}"]

    words = [cell for (cell,) in rows(row, [each for each in conditions if each.controller not in ALONE])]
    when = "in the second that begins 5 s after the load was taken up" if loaded else "from 12 s on"
    return f"{title}. A tenth of PD alone in trunk and both arms, {when}: {'; '.join(words)}."


def _compared(
    o: Outcomes, less: Callable[[Condition, str], Floats], more: Callable[[Condition, str], Floats]
) -> list[bool]:
    """Return where one error is below another, limb by limb, of both forms from zero at rest in poses one and two."""
    pairs = ((less(*each), more(*each)) for each in product((COMPACT, FULL), RESTS))
    return [bool(each) for below, above in pairs for each in below.mean(axis=0) < above.mean(axis=0)]


FIGURE_5 = Experiment(
    "regressor-figure-5", "figure 5", "19 joints learn their gravity", OF_FIGURE_5, cases_5, report_5, minutes=10.0
)


@FIGURE_5.claim(
    "The position error reduces in 7-12 s, as gravity is estimated",
    "III-B, figure 5",
    "a picture, no numbers",
    f"in {LIMB_WORDS} the error of the last second is less than half of that before 7 s, mean over robots, on the "
    "compact and on the full Z from zero; same direction: in more than half of these six",
)
def _shrinks(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for each in (COMPACT, FULL):
        holds += list(rms(o, each, LEARNT).mean(axis=0) < HALF * rms(o, each, BEFORE).mean(axis=0))
        texts.append(f"{each.label}: {of_limbs(o, each, BEFORE)} to {of_limbs(o, each, LEARNT)} deg")
    return by_count(holds, f"mean of the limbs, {'; '.join(texts)}")


@FIGURE_5.claim(
    "When the robot approaches the desired positions, some error remains",
    "III-B, figure 5",
    '"it makes some error", no numbers',
    "at rest in poses one and two every limb's error is above that at the end of the estimation, mean over robots, "
    "both forms from zero",
)
def _some_error(o: Outcomes) -> Judgement:
    holds = _compared(o, lambda each, _: rms(o, each, LEARNT), lambda each, window: rms(o, each, window))
    texts = [f"{each.label}, {span}: {of_limbs(o, each, span)} deg" for each, span in product((COMPACT, FULL), RESTS)]
    return by_count(holds, f"mean of the limbs, {'; '.join(texts)}")


@FIGURE_5.claim(
    "With gravity estimated the errors are smaller than with PD alone",
    "figures 4 and 5",
    "pictures, no numbers",
    "at rest in poses one and two every limb's error is below PD alone's, mean over robots, both forms from zero; same "
    "direction: in more than half of these twelve",
)
def _beside_none(o: Outcomes) -> Judgement:
    holds = _compared(o, lambda each, window: rms(o, each, window), lambda each, window: rms(o, each.reference, window))
    shares = {
        (each, when): 100.0 * _over_alone(o, each, when).mean(axis=1) for each in (COMPACT, FULL) for when in RESTS
    }
    text = "; ".join(f"{each.label}, {when}: {kept:.0f} %" for (each, when), kept in shares.items())
    return by_count(holds, f"of PD alone, mean of the limbs, {text}")


@FIGURE_5.claim(
    "The remaining error can be reduced by estimating for longer",
    "III-B",
    '"for long time more than this trial"',
    "the same law from 7 s to the end leaves less in every limb at rest in poses one and two, mean over robots",
)
def _longer_is_better(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for window in RESTS:
        holds += list(rms(o, LONGER, window).mean(axis=0) < rms(o, COMPACT, window).mean(axis=0))
        texts.append(f"{window}: {of_limbs(o, COMPACT, window)} to {of_limbs(o, LONGER, window)} deg")
    return by_count(holds, f"mean of the limbs, {'; '.join(texts)}")


@FIGURE_5.claim(
    "Once estimated, the parameters give the gravitational force",
    "abstract, III",
    "in simulation, no numbers",
    "at rest in poses one and two the PD term has less than half of its torque without estimation to give, in every "
    "limb, mean over robots, both forms from zero; same direction: in more than half of these twelve",
    "the law learns one pose, which cannot tell all combinations of 19 joints",
)
def _give_the_force(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for each, window in product((COMPACT, FULL), RESTS):
        share = force_left(o, each, window) / force_left(o, PRINTED, window)
        holds += list(share.mean(axis=0) < HALF)
        texts.append(f"{each.label}, {window}: {by_robot(100.0 * share.mean(axis=1)):.0f} %")
    return by_count(holds, f"left of the torque, mean of the limbs: {'; '.join(texts)}")


@FIGURE_5.claim(
    "Estimation should be performed under the quasi-static state",
    "II-A, III",
    "no numbers",
    "the same law for five seconds on the same robot, once at rest and once while it homes, from zero on the compact "
    "Z: at rest in poses one and two, every limb has less torque left after the former, mean over robots; same "
    "direction: in more than half of these six",
)
def _quasi_static(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for window in RESTS:
        still, moving = (force_left(o, each, window) for each in (COMPACT, MOVING))
        holds += list(still.mean(axis=0) < moving.mean(axis=0))
        still, moving = (by_robot(each.mean(axis=1)) for each in (still, moving))
        texts.append(f"{window}: {still:.2f} Nm learnt at rest, {moving:.2f} Nm learnt while moving")
    return by_count(holds, f"mean of the limbs, {'; '.join(texts)}")
