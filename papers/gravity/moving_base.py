"""Figure 10 of the gravity paper: tracking errors of three controllers on a rocking base.

Lewis and Hannaford 2014, sections IV-B and V-C: figure 9's motion while the base is rocked about Z0 between 10 and 20
degrees at 1 Hz; beside it the same on bases at rest at 10, 15 and 20 degrees, which are figure 9's. DG takes the last
sample of an accelerometer at 100 Hz, as the paper's did; beside it the same accelerometer through this package's
estimator, an inertial unit, whose gyroscope tells what turning adds, and an ideal accelerometer at every tick.
"""

from itertools import chain, pairwise

from papers.claims import Claims, by_count, graded
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Scope, TitledPicture
from papers.gravity import figure_9
from papers.gravity.tracking import ADAPTIVE, CALLED, CONTROLLERS, ROCKING, ROCKING_ASIDE, SENSORS, follow_sinusoids
from papers.kit import UNITS, filled, grid, table, told

SENSED = tuple((name, "absolute") for name in SENSORS)
NAMES = ("pd", "sg", *SENSORS)
PASSED = ("10", "15", "20")  # angles that the base is rocked through [deg]; cases are figure 9's
LITTLE = 5.0  # percent of PD's Cartesian error that count as little effect


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and group of controllers."""
    if scope.quick:
        return figure_9.quick(ROCKING, figure_9.USUAL)
    usual, sensed = figure_9.USUAL, (*figure_9.USUAL[:2], *SENSED)
    return [
        *grid(follow_sinusoids, {"seed": scope.robots}, base=ROCKING, way="increments", controllers=sensed),
        follow_sinusoids.case(seed=None, base=ROCKING, way="joints", controllers=usual),
        *grid(follow_sinusoids, {"seed": scope.robots, "base": PASSED}, way="increments", controllers=usual),
    ]


def report(o: Outcomes) -> Report:
    """Return the paper's picture, and its table for either way of sending."""
    tables = [
        table(title, figure_9.ERRORS, figure_9.error_rows(o, (ROCKING,), way, NAMES))
        for way, title in figure_9.WAYS.items()
    ]
    caption = "RMS of desired minus reported position on the rocking base; large dots are means, small ones robots"
    return Report(filled(tables), [TitledPicture(caption, figure_9.picture(o, (ROCKING,), NAMES))])


CLAIMS = Claims()


@CLAIMS(
    "On the rocking base joint 1's tracking improves by the same 12 %",
    "V-C, figure 10",
    "12 %",
    f"DG within {figure_9.CLOSE:.0f} percentage points of 12 % below PD in the mean over robots; same direction: below",
)
def _gain(o: Outcomes) -> Judgement:
    return figure_9.gain_of_dg(o, ROCKING)


@CLAIMS(
    "Compensation has little collective effect on Cartesian tracking",
    "V-C",
    "little; no number",
    f"the tip's RMS error, as reported, changes by less than {LITTLE:.0f} % with SG and with DG, mean over robots",
)
def _little_effect(o: Outcomes) -> Judgement:
    plain = figure_9.of(o, "pd", "tip_mm", 3, base=ROCKING)
    changes = {
        name.upper(): 100.0 * (figure_9.of(o, name, "tip_mm", 3, base=ROCKING) / plain - 1.0)
        for name in CONTROLLERS[1:]
    }
    little = all(abs(each.mean()) < LITTLE for each in changes.values())
    return graded(little, False, f"tip's error against PD: {told(changes, '.1f', ' %')}")


@CLAIMS(
    "DG improves over SG on the rocking base as it does on bases at rest",
    "VI",
    "the same improvements; no number",
    "DG's joint 1 error below SG's on the rocking base by a share that lies between those at 10, 15 and 20 deg, mean "
    "over robots; same direction: below",
)
def _same_over_static(o: Outcomes) -> Judgement:
    rocked, *still = (figure_9.gains(o, "dg", 0, base, over="sg") for base in (ROCKING, *PASSED))
    means = [each.mean() for each in still]
    at_rest = told(dict(zip(map(figure_9.base_told, PASSED), still, strict=True)), ".1f", " %")
    said = f"joint 1, DG below SG: rocking {rocked:.1f} %; at rest {at_rest}"
    return graded(min(means) <= rocked.mean() <= max(means), rocked.mean() > 0.0, said)


FIGURE_10 = Experiment(
    "gravity-figure-10", "figure 10", "Tracking on a rocking base", __doc__, cases, report, minutes=9.0, claims=CLAIMS
)


OF_ADAPTIVE = """Adaptive gravity compensation on tilted and rocking bases: the paper's reference [8].

Lewis and Hannaford 2014, section II-C, of Dunnigan and Wronka's comparison on a moving base: tracking improved with a
sensor of the base in all controllers, and was best with an adaptive gravity term. Here figure 9's motion on the base
at 20 degrees and on the rocking one, sent as workspace increments, with the paper's accelerometer at 100 Hz or none.
Figure 10's base is rocked about an axis through its origin, where there is no acceleration to sense: what an
accelerometer adds to an orientation sensor, the true attitude, is looked at on a base that is rocked alike about an
axis 0.32 m away.

The adaptive terms are this package's: the pseudo-inverse law of the gravity-regressor paper at its rate of 2 per
second, and recursive least squares with forgetting. Both know the arm's geometry, and no mass; both begin from zero
on the way to the motion's start, and learn in motion too, for which neither was made. Without a sensor they take the
base for level, and what it is not goes into the masses. Masses that are wrong so are right near where they were
learnt. Damping is the robot's own, absolute; beside it relative damping with joint references on the nominal robot.
"""
LEARNT = tuple((name, "absolute") for name in ADAPTIVE)
RELATIVE = tuple((name, "relative") for name in (*CONTROLLERS, *ADAPTIVE))
COMPARED = (*CONTROLLERS, *ADAPTIVE)
BASES = (figure_9.LAST, ROCKING)
# of each controller: without a sensor, with one of orientation, with an accelerometer
LADDERS = {
    "model": ("sg", "dg-attitude", "dg"),
    "adaptive": ("adaptive", "adaptive-attitude", "adaptive-dg"),
    "least squares": ("recursive", "recursive-attitude", "recursive-dg"),
}
SENSOR_LADDERS = tuple(tuple((name, "absolute") for name in ladder) for ladder in LADDERS.values())
ASIDE_CASES = ((("pd", "absolute"), *SENSOR_LADDERS[0]), (*SENSOR_LADDERS[1], *SENSOR_LADDERS[2]))


def adaptive_cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, base and group of controllers; those of figures 9 and 10 are theirs."""
    if scope.quick:
        return figure_9.quick(ROCKING, (("adaptive-dg", "absolute"),))
    usual = {figure_9.LAST: figure_9.USUAL, ROCKING: (*figure_9.USUAL[:2], *SENSED)}
    wanted = [(base, group) for base in BASES for group in (usual[base], LEARNT)]
    found = [
        follow_sinusoids.case(seed=seed, base=base, way="increments", controllers=group)
        for seed in scope.robots
        for base, group in wanted
    ]
    found += grid(
        follow_sinusoids, {"seed": scope.robots, "controllers": ASIDE_CASES}, base=ROCKING_ASIDE, way="increments"
    )
    return found + grid(follow_sinusoids, {"base": BASES}, seed=None, way="joints", controllers=RELATIVE)


def adaptive_report(o: Outcomes) -> Report:
    """Return errors of every controller on all bases, with either damping, and their picture."""
    by_sensor = "By sensor of a base that is rocked about an axis 0.32 m away, sent as workspace increments"
    aside = ("pd", *chain(*LADDERS.values()))
    relative = "Damping relative to the reference, joint references, nominal robot: base "
    tables = [
        table("Sent as workspace increments", figure_9.ERRORS, figure_9.error_rows(o, BASES, "increments", COMPARED)),
        table(by_sensor, figure_9.ERRORS, figure_9.error_rows(o, (ROCKING_ASIDE,), "increments", aside)),
        *(
            table(
                relative + ("rocking" if base == ROCKING else f"at {base} deg"),
                figure_9.OTHER,
                figure_9.other_rows(o, base),
            )
            for base in BASES
        ),
    ]
    caption = "RMS of desired minus reported position; large dots are means, small ones robots"
    return Report(
        filled(tables), [TitledPicture(caption, figure_9.picture(o, BASES, COMPARED))], _with_relative_damping(o)
    )


def _with_relative_damping(o: Outcomes) -> list[str]:
    """Say how far the adaptive law is off where the damping is not the robot's own, which the claims rest on."""
    parts = []
    for base in BASES:
        if o.of(follow_sinusoids, base=base, way="joints", controllers=[list(each) for each in RELATIVE]):
            plain, law = (figure_9.errors(o, name, base, "joints", "relative")[:, 0] for name in ("pd", "adaptive-dg"))
            where = "on the rocking base" if base == ROCKING else f"at {base} deg"
            parts.append(f"{where} by {law:.2f} deg, PD alone by {plain:.2f} deg")
    if not parts:
        return []
    return [
        "What the claims say of the adaptive law holds with the robot's own damping, which is absolute: the law then "
        f"learns away a part of the lag. With damping relative to the reference its joint 1 is off {', '.join(parts)}."
    ]


ADAPTIVE_CLAIMS = Claims()


@ADAPTIVE_CLAIMS(
    "On a moving base joints follow best with an adaptive gravity term",
    "II-C, of its reference [8]",
    "best; no number",
    "on the rocking base, with the robot's own absolute damping, one of the adaptive terms has the smallest RMS error "
    "of all controllers here on every joint, mean over robots; same direction: on two of three",
)
def _best(o: Outcomes) -> Judgement:
    found = {name: figure_9.errors(o, name, ROCKING) for name in COMPARED}
    best = [min(COMPARED, key=lambda name: float(found[name][:, joint].mean())) for joint in range(3)]
    said = ", ".join(f"J{j + 1} {CALLED[name]} {found[name][:, j]} {UNITS[j]}" for j, name in enumerate(best))
    return by_count([name in ADAPTIVE for name in best], f"best: {said}")


@ADAPTIVE_CLAIMS(
    "An adaptive term also compensates what is not modelled",
    "II-C, of its reference [8]",
    "it could; no number",
    "at 20 deg, where DG knows gravity, with the robot's own absolute damping, the adaptive law with the same "
    "accelerometer has a smaller RMS error than DG on every joint, mean over robots; same direction: on two of three",
)
def _unmodelled(o: Outcomes) -> Judgement:
    law, known = (figure_9.errors(o, name) for name in ("adaptive-dg", "dg"))
    said = ", ".join(f"J{j + 1} {law[:, j]} against {known[:, j]} {unit}" for j, unit in enumerate(UNITS))
    return by_count(law.mean(axis=0) < known.mean(axis=0), said)


@ADAPTIVE_CLAIMS(
    "Every controller follows better with an orientation sensor of the base, and better still with an accelerometer",
    "II-C, of its reference [8]",
    "greatly improved, further improved; no number",
    "on the base rocked about an axis 0.32 m away joint 1's RMS error falls at both steps, with the model and with "
    "both adaptive terms, mean over robots; same direction: in more than half of these six",
    "With the model both steps help. A term that learns in motion takes up what the joints lack whatever it believes "
    "of gravity's direction, and follows better than the model even without a sensor (table): a sensor has little left "
    "to add to it.",
)
def _sensor_helps(o: Outcomes) -> Judgement:
    found = {
        kind: [figure_9.errors(o, name, ROCKING_ASIDE)[:, 0] for name in ladder] for kind, ladder in LADDERS.items()
    }
    said = "; ".join(f"{kind} {', '.join(f'{each}' for each in ladder)}" for kind, ladder in found.items())
    falls = [less.mean() > more.mean() for ladder in found.values() for less, more in pairwise(ladder)]
    return by_count(falls, f"joint 1 [deg], no sensor, orientation, accelerometer: {said}")


@ADAPTIVE_CLAIMS(
    "Joint 1 follows better where changes in the magnitude of acceleration are compensated, beside those of gravity's "
    "direction",
    "VI",
    "performance increased; no number",
    "on the base rocked about an axis 0.32 m away joint 1's RMS error is smaller with DG by the accelerometer than "
    "with DG by the true attitude, mean over robots",
)
def _magnitude(o: Outcomes) -> Judgement:
    direction, both = (figure_9.errors(o, name, ROCKING_ASIDE)[:, 0] for name in LADDERS["model"][1:])
    gain = 100.0 * (1.0 - both / direction)
    said = f"joint 1 {direction} deg by direction alone, {both} deg with magnitude: {gain:.1f} % less"
    return by_count([gain.mean() > 0.0], said)


ADAPTIVE_COMPENSATION = Experiment(
    "gravity-adaptive", "reference [8]", "Adaptive gravity compensation on tilted and rocking bases", OF_ADAPTIVE,
    adaptive_cases, adaptive_report, minutes=12.0, claims=ADAPTIVE_CLAIMS, drawn=2,
)  # fmt: skip
