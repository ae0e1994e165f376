"""Figure 10 of the gravity paper: tracking errors of three controllers on a rocking base.

Lewis and Hannaford 2014, sections IV-B and V-C: figure 9's motion while the base is rocked about Z0 between 10 and 20
degrees at 1 Hz; beside it the same on bases at rest at 10, 15 and 20 degrees, which are figure 9's. DG takes the last
sample of an accelerometer at 100 Hz, as the paper's did; beside it the same accelerometer through this package's
estimator, an inertial unit, whose gyroscope tells what turning adds, and an ideal accelerometer at every tick.
"""

from functools import partial

import numpy as np

from catenary.arrays import Floats
from papers.claims import graded, mean_and_spread
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
from papers.gravity.figure_9 import CLOSE, USUAL, error_table, errors, gain_of_dg, picture
from papers.gravity.tracking import CONTROLLERS, ROCKING, SENSORS, follow_sinusoids

SENSED = tuple((name, "absolute") for name in SENSORS)
NAMES = ("pd", "sg", *SENSORS)
PASSED = ("10", "15", "20")  # angles that the base is rocked through [deg]; cases are figure 9's
LITTLE = 5.0  # percent of PD's Cartesian error that count as little effect


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and group of controllers."""
    if scope.quick:
        return [
            follow_sinusoids.case(seed=None, base=ROCKING, way="increments", controllers=USUAL, cycles=1, axes=["y"])
        ]
    return [
        *(
            follow_sinusoids.case(seed=seed, base=ROCKING, way=way, controllers=wanted)
            for seed in scope.robots
            for way, wanted in (("increments", (*USUAL[:2], *SENSED)), ("joints", USUAL))
        ),
        *(
            follow_sinusoids.case(seed=seed, base=base, way="increments", controllers=USUAL)
            for seed in scope.robots
            for base in PASSED
        ),
    ]


def report(outcomes: Outcomes) -> Report:
    """Return the paper's picture, and its table for either way of sending."""
    base = (ROCKING,)
    sent, joints = (error_table(outcomes, base, way, NAMES) for way in ("increments", "joints"))
    tables = [TitledTable("Sent as workspace increments, as the paper did", sent)]
    if joints.rows:
        tables.append(TitledTable("Sent as joint references", joints))
    caption = "RMS of desired minus reported position on the rocking base; bars are means, dots are robots"
    return Report(tables, [TitledPicture(caption, picture(outcomes, base, NAMES))])


def _little_effect(outcomes: Outcomes) -> Judgement:
    found = outcomes.of(follow_sinusoids, base=ROCKING, way="increments")
    changes = {
        name: [100.0 * (one[f"{name} absolute"]["tip_mm"][3] / one["pd absolute"]["tip_mm"][3] - 1.0) for one in found]
        for name in CONTROLLERS[1:]
    }
    told = ", ".join(f"{name.upper()} {mean_and_spread(values, 1)} %" for name, values in changes.items())
    little = all(abs(sum(values) / len(values)) < LITTLE for values in changes.values())
    return Judgement("reproduced" if little else "not reproduced", f"tip's error against PD: {told}")


def _over_static(outcomes: Outcomes, base: str) -> Floats:
    """Return by how many percent joint 1's error with DG is below that with SG, robot by robot."""
    sg, dg = (errors(outcomes, base, "increments", name)[:, 0] for name in ("sg", "dg"))
    return 100.0 * (1.0 - dg / sg) if len(sg) == len(dg) else np.zeros(0)


def _same_over_static(outcomes: Outcomes) -> Judgement:
    rocked, still = _over_static(outcomes, ROCKING), {base: _over_static(outcomes, base) for base in PASSED}
    means = [float(each.mean()) for each in still.values()]
    told = ", ".join(f"{base} deg {mean_and_spread(each, 1)} %" for base, each in still.items())
    mean = float(rocked.mean())
    return graded(
        min(means) <= mean <= max(means),
        mean > 0.0,
        f"joint 1, DG below SG: rocking {mean_and_spread(rocked, 1)} %; at rest {told}",
    )


CLAIMS = (
    Claim(
        "On the rocking base joint 1's tracking improves by the same 12 %",
        "V-C, figure 10",
        "12 %",
        f"DG within {CLOSE:.0f} percentage points of 12 % below PD in the mean over robots; same direction: below",
        partial(gain_of_dg, base=ROCKING),
    ),
    Claim(
        "Compensation has little collective effect on Cartesian tracking",
        "V-C",
        "little; no number",
        f"the tip's RMS error, as reported, changes by less than {LITTLE:.0f} % with SG and with DG, mean over robots",
        _little_effect,
    ),
    Claim(
        "DG improves over SG on the rocking base as it does on bases at rest",
        "VI",
        "the same improvements; no number",
        "DG's joint 1 error below SG's on the rocking base by a share that lies between those at 10, 15 and 20 deg, "
        "mean over robots; same direction: below",
        _same_over_static,
    ),
)

EXPERIMENT = Experiment(
    name="gravity-figure-10",
    paper="gravity",
    place="figure 10",
    title="Tracking on a rocking base",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=12.0,
    claims=CLAIMS,
)
