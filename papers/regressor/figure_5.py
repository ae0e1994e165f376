"""Figure 5 of the gravity-regressor paper: 19 joints learn their gravity while they are controlled.

tau = Kp (q_d - q) - Kd qd + Z s_hat on the paper's timeline at 1 kHz, simulated in MuJoCo. As printed: the law runs
from 7 to 12 s and holds what it knows after; on the compact or the full Z (the paper does not say which it ran), from
s_0 = 0 as the paper assumes, and from wrong parameters: masses 0.5 to 2 times and centres of mass 0.5 to 1.5 times
the true ones. "Longer": the same law from 7 s to the end of the motion.

Beside it ours, damping Kd (qd_d - qd): the law all the time, holding still by itself while the arm moves, and
recursive least squares on torques at rest. Beyond the paper: the right hand takes up 2 kg at 21 s, unknown to all;
the least squares know that a hand may.

Poses, gains and rotors are ours where the paper states none: papers/regressor/dual_arm.py. The paper has one robot; the
spread is over robots whose masses differ by up to 30 % and centres of mass by up to 20 %.
"""

from collections.abc import Sequence

from papers.claims import by_count, mean_and_spread
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
from papers.regressor.dual_arm import ALONE, LIMBS
from papers.regressor.dual_arm_tables import (
    AFTER,
    BEFORE,
    LEARNT,
    RESTS,
    Condition,
    cases_of,
    errors_picture,
    rms,
    share,
    share_table,
    window_table,
)

COMPACT, FULL, LONGER = (Condition(f"printed-{word}") for word in ("compact", "full", "longer"))
LAW, LEAST_SQUARES = Condition("law"), Condition("rls")
AS_PRINTED = (
    Condition("printed-pd"),
    COMPACT,
    FULL,
    Condition("printed-compact", "wrong"),
    Condition("printed-full", "wrong"),
    LONGER,
)
OURS = (Condition("pd"), LAW, Condition("law", "wrong"), LEAST_SQUARES, Condition("rls", "wrong"))
LOADED = tuple(Condition(name, payload_kg=2.0) for name in ("pd", "law", "rls"))
QUICK = (Condition("printed-pd"), COMPACT)
HALF, TENTH = 0.5, 0.1


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every robot and controller."""
    return cases_of(QUICK if scope.quick else (*AS_PRINTED, *OURS, *LOADED), scope)


def report(outcomes: Outcomes) -> Report:
    """Return errors by limb and window, what part of PD alone's they are, and the paper's picture."""
    tables, pictures, remarks = [], [], []
    for title, conditions, drawn in (
        ("As the paper ran it", AS_PRINTED, (COMPACT, FULL)),
        ("Ours", OURS, (LAW, LEAST_SQUARES)),
        ("With 2 kg from 21 s, ours", LOADED, LOADED),
    ):
        whole = window_table(outcomes, conditions)
        if not whole.rows:
            continue
        tables += [
            TitledTable(f"{title}: RMS error [deg]", whole),
            TitledTable(f"{title}: of PD alone, worst limb", share_table(outcomes, conditions)),
        ]
        there = [each for each in drawn if len(rms(outcomes, each, BEFORE))]
        pictures.append(
            TitledPicture(f"{title}: error of each joint; shaded: 7 to 12 s", errors_picture(outcomes, there))
        )
        remarks.append(_tenth(outcomes, title, conditions))
    return Report(tables, pictures, remarks)


def _tenth(outcomes: Outcomes, title: str, conditions: Sequence[Condition]) -> str:
    """Say which controllers brought the error of every limb to a tenth of PD alone's."""
    loaded = conditions[0].payload_kg > 0.0
    window = RESTS[1] if loaded else AFTER
    words = []
    for condition in conditions:
        kept = share(outcomes, condition, window)
        if condition.controller not in ALONE and kept is not None:
            words.append(f"{condition.label}: {'reached' if kept <= TENTH else 'not reached'}")
    when = "in the second that begins 5 s after the load was taken up" if loaded else "from 12 s on"
    return f"{title}. A tenth of PD alone in trunk and both arms, {when}: {'; '.join(words)}."


def _parts(outcomes: Outcomes, conditions: Sequence[Condition], windows: Sequence[str]) -> list[tuple[Condition, str]]:
    return [
        (condition, window) for condition in conditions for window in windows if len(rms(outcomes, condition, window))
    ]


def _limbs_mean(outcomes: Outcomes, condition: Condition, window: str) -> str:
    """Return the mean of the limbs' errors, and its spread over robots, as text."""
    return mean_and_spread(rms(outcomes, condition, window).mean(axis=1))


def _shrinks(outcomes: Outcomes) -> Judgement:
    holds: list[bool] = []
    told = []
    for condition, _ in _parts(outcomes, (COMPACT, FULL), (LEARNT,)):
        before, after = (rms(outcomes, condition, window).mean(axis=0) for window in (BEFORE, LEARNT))
        holds += list(after < HALF * before)
        told.append(
            f"{condition.label}: {_limbs_mean(outcomes, condition, BEFORE)} to "
            f"{_limbs_mean(outcomes, condition, LEARNT)} deg"
        )
    return by_count(holds, f"mean of the limbs, {'; '.join(told)}")


def _some_error(outcomes: Outcomes) -> Judgement:
    holds: list[bool] = []
    told = []
    for condition, window in _parts(outcomes, (COMPACT, FULL), RESTS):
        there, learnt = (rms(outcomes, condition, name).mean(axis=0) for name in (window, LEARNT))
        holds += list(there > learnt)
        told.append(f"{condition.label}, {window}: {_limbs_mean(outcomes, condition, window)} deg")
    return by_count(holds, f"mean of the limbs, {'; '.join(told)}")


def _beside_none(outcomes: Outcomes) -> Judgement:
    holds: list[bool] = []
    told = []
    for condition, window in _parts(outcomes, (COMPACT, FULL), RESTS):
        own, alone = (rms(outcomes, each, window) for each in (condition, condition.reference))
        if len(own) != len(alone):
            continue
        holds += list(own.mean(axis=0) < alone.mean(axis=0))
        left = (100.0 * own / alone).mean(axis=1)
        told.append(f"{condition.label}, {window}: {mean_and_spread(left, 0)} %")
    return by_count(holds, f"of PD alone, mean of the limbs, {'; '.join(told)}")


def _longer_is_better(outcomes: Outcomes) -> Judgement:
    holds: list[bool] = []
    told = []
    for condition, window in _parts(outcomes, (LONGER,), RESTS):
        longer, short = (rms(outcomes, each, window).mean(axis=0) for each in (condition, COMPACT))
        if len(short):
            holds += list(longer < short)
            told.append(
                f"{window}: {_limbs_mean(outcomes, COMPACT, window)} to {_limbs_mean(outcomes, condition, window)} deg"
            )
    return by_count(holds, f"mean of the limbs, {'; '.join(told)}")


LIMB_WORDS = ", ".join(LIMBS)
CLAIMS = (
    Claim(
        "The position error reduces in 7-12 s, as gravity is estimated",
        "III-B, figure 5",
        "a picture, no numbers",
        f"in {LIMB_WORDS} the error of the last second is less than half of that before 7 s, mean over robots, on the "
        "compact and on the full Z from zero; same direction: in more than half of these six",
        _shrinks,
    ),
    Claim(
        "When the robot approaches the desired positions, some error remains",
        "III-B, figure 5",
        '"it makes some error", no numbers',
        "at rest in poses one and two every limb's error is above that at the end of the estimation, mean over robots, "
        "both forms from zero",
        _some_error,
    ),
    Claim(
        "With gravity estimated the errors are smaller than with PD alone",
        "figures 4 and 5",
        "pictures, no numbers",
        "at rest in poses one and two every limb's error is below PD alone's, mean over robots, both forms from zero; "
        "same direction: in more than half of these twelve",
        _beside_none,
    ),
    Claim(
        "The remaining error can be reduced by estimating for longer",
        "III-B",
        '"for long time more than this trial"',
        "the same law from 7 s to the end leaves less in every limb at rest in poses one and two, mean over robots",
        _longer_is_better,
    ),
)

EXPERIMENT = Experiment(
    name="regressor-figure-5",
    paper="regressor",
    place="figure 5",
    title="19 joints learn their gravity",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=20.0,
    claims=CLAIMS,
)
