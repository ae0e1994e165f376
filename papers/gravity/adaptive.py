"""Adaptive gravity compensation on tilted and rocking bases, beside PD, PD+SG and PD+DG: the paper's reference [8].

Lewis and Hannaford 2014, section II-C, of Dunnigan and Wronka's comparison on a moving base: tracking improved with a
sensor of the base in all controllers, and was best with an adaptive gravity term. Here figure 9's motion on the base
at 20 degrees and on the rocking one, sent as workspace increments, with the paper's accelerometer at 100 Hz or none.

The adaptive terms are this package's: the pseudo-inverse law of the gravity-regressor paper at its rate of 2 per
second, and recursive least squares with forgetting. Both know the arm's geometry, and no mass; both begin from zero
on the way to the motion's start, and learn in motion too, for which neither was made. Without a sensor they take the
base for level, and what it is not goes into the masses. Masses that are wrong so are right near where they were
learnt. Damping is the robot's own, absolute; beside it relative damping with joint references on the nominal robot.
"""

from papers.claims import NOT_MEASURED, by_count
from papers.experiment import (
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
)
from papers.gravity.figure_9 import LAST, USUAL, error_table, errors, others_of, picture
from papers.gravity.figure_10 import SENSED
from papers.gravity.tracking import ADAPTIVE, CONTROLLERS, ROCKING, follow_sinusoids

LEARNT = tuple((name, "absolute") for name in ADAPTIVE)
RELATIVE = tuple((name, "relative") for name in (*CONTROLLERS, *ADAPTIVE))
NAMES = (*CONTROLLERS, *ADAPTIVE)
BASES = (LAST, ROCKING)
SENSED_AND_NOT = (("sg", "dg"), ("adaptive", "adaptive-dg"), ("recursive", "recursive-dg"))


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, base and group of controllers; those of figures 9 and 10 are theirs."""
    if scope.quick:
        one = (("adaptive-dg", "absolute"),)
        return [
            follow_sinusoids.case(
                seed=None, base=ROCKING, way="increments", controllers=one, cycles=1, axes=["y"]
            )
        ]
    usual = {LAST: USUAL, ROCKING: (*USUAL[:2], *SENSED)}
    return [
        *(
            follow_sinusoids.case(seed=seed, base=base, way="increments", controllers=wanted)
            for seed in scope.robots
            for base in BASES
            for wanted in (usual[base], LEARNT)
        ),
        *(follow_sinusoids.case(seed=None, base=base, way="joints", controllers=RELATIVE) for base in BASES),
    ]


def report(outcomes: Outcomes) -> Report:
    """Return errors of every controller on both bases, with either damping, and their picture."""
    tables = [
        TitledTable("Sent as workspace increments", error_table(outcomes, BASES, "increments", NAMES)),
        *(
            TitledTable(
                f"Damping relative to the reference, joint references, nominal robot: base "
                f"{'rocking' if base == ROCKING else f'at {base} deg'}",
                others_of(outcomes, base),
            )
            for base in BASES
        ),
    ]
    caption = "RMS of desired minus reported position; bars are means, dots are robots"
    drawn = TitledPicture(caption, picture(outcomes, BASES, NAMES))
    return Report([one for one in tables if one.table.rows], [drawn])


def _means(outcomes: Outcomes, base: str) -> dict[str, list[float]]:
    """Return every controller's mean error of each joint; nothing where one of them is missing."""
    found = {name: errors(outcomes, base, "increments", name) for name in NAMES}
    if not all(len(values) for values in found.values()):
        return {}
    return {name: [float(value) for value in values.mean(axis=0)] for name, values in found.items()}


def _best(outcomes: Outcomes) -> Judgement:
    means = _means(outcomes, ROCKING)
    if not means:
        return NOT_MEASURED
    best = [min(NAMES, key=lambda name: means[name][joint]) for joint in range(3)]
    told = ", ".join(f"J{joint + 1} {name} {means[name][joint]:.3f}" for joint, name in enumerate(best))
    return by_count([name in ADAPTIVE for name in best], f"best: {told}")


def _unmodelled(outcomes: Outcomes) -> Judgement:
    means = _means(outcomes, LAST)
    if not means:
        return NOT_MEASURED
    told = ", ".join(
        f"J{joint + 1} {means['adaptive-dg'][joint]:.3f} against {means['dg'][joint]:.3f}"
        for joint in range(3)
    )
    return by_count([means["adaptive-dg"][joint] < means["dg"][joint] for joint in range(3)], told)


def _sensor_helps(outcomes: Outcomes) -> Judgement:
    means = _means(outcomes, ROCKING)
    if not means:
        return NOT_MEASURED
    told = ", ".join(
        f"{with_} {means[with_][0]:.3f}, {none} {means[none][0]:.3f}" for none, with_ in SENSED_AND_NOT
    )
    return by_count(
        [means[with_][0] < means[none][0] for none, with_ in SENSED_AND_NOT], f"joint 1: {told} deg"
    )


CLAIMS = (
    Claim(
        "On a moving base joints follow best with an adaptive gravity term",
        "II-C, of its reference [8]",
        "best; no number",
        "on the rocking base one of the adaptive terms has the smallest RMS error of all controllers here on every "
        "joint, mean over robots; same direction: on two of three",
        _best,
    ),
    Claim(
        "An adaptive term also compensates what is not modelled",
        "II-C, of its reference [8]",
        "it could; no number",
        "at 20 deg, where DG knows gravity, the adaptive law with the same accelerometer has a smaller RMS error than "
        "DG on every joint, mean over robots; same direction: on two of three",
        _unmodelled,
    ),
    Claim(
        "Every controller follows better with a sensor of the base than without",
        "II-C, of its reference [8]",
        "greatly improved; no number",
        "on the rocking base joint 1's RMS error is smaller with the accelerometer than without for the model (DG, "
        "SG) and for both adaptive terms, mean over robots; same direction: for two of three",
        _sensor_helps,
        "A term that learns in motion takes up what the joints lack whatever it believes of gravity's direction: on "
        "the nominal robot it follows better than DG without a sensor too, so a sensor has little left to add.",
    ),
)

EXPERIMENT = Experiment(
    name="gravity-adaptive",
    paper="gravity",
    place="reference [8]",
    title="Adaptive gravity compensation on tilted and rocking bases",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=11.0,
    claims=CLAIMS,
    drawn=2,
)
