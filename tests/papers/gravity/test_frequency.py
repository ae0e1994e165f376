import pytest

from papers.experiment import Case, Outcomes, Result, Scope
from papers.gravity.frequency import (
    ACCELEROMETER,
    BASE_HZ,
    CLAIMS,
    FREQUENCIES,
    HELD,
    MOTIONS,
    NONE,
    UNIT,
    WAYS,
    cases,
    report,
    responses,
)


def made_up(unstable: dict[str, float]) -> Outcomes:
    sizes = {motion: {name: [0.0] * len(BASE_HZ) for name in WAYS} for motion in MOTIONS}
    swinging = {motion: {name: list(values) for name, values in by.items()} for motion, by in sizes.items()}
    for name, size in unstable.items():
        swinging["x"][name][2] = size
    result: Result = {
        "response": {name: [0.1] * len(FREQUENCIES) for name in WAYS},
        "curves": {
            "rocking_hz": [0.1, 1.0],
            "joint": {name: [0.1, 0.2] for name in WAYS},
            "around_hz": [1.0, 10.0],
            "around": {name: [0.01, 0.2] for name in WAYS},
        },
        "stable": sizes,
        "unstable": swinging,
        "own": dict.fromkeys(MOTIONS, 1.5),
        "sustained": [{"acceleration": 1.0, "lacking": [0.3, 0.1, 0.2], "off": [0.04, 0.01, 0.003]}],
    }
    (case,) = cases(Scope())
    return Outcomes({case: result})


@pytest.mark.parametrize(
    ("unstable", "verdict"),
    [
        ({HELD: 2.0}, "reproduced"),
        ({ACCELEROMETER: 1.6, UNIT: 3.0}, "reproduced"),
        ({ACCELEROMETER: 1.5}, "same direction"),
        ({UNIT: 3.0}, "same direction"),
        ({NONE: 3.0}, "not reproduced"),  # no sensor: no feedback through one
        ({}, "not reproduced"),
    ],
)
def test_an_instability_needs_a_base_that_has_mass_and_an_accelerometer(
    unstable: dict[str, float], verdict: str
) -> None:
    assert CLAIMS[0].judge(made_up(unstable)).verdict == verdict


def test_without_results_nothing_is_judged() -> None:
    assert CLAIMS[0].judge(Outcomes({})).verdict == "not measured"


def test_tables_say_which_bases_swing_up() -> None:
    swinging = report(made_up({HELD: 2.0})).tables[2].table
    row = dict(zip(swinging.header, swinging.rows[2], strict=True))
    assert row == {"base": "x, 10 Hz", NONE: "none", HELD: "2 kg", ACCELEROMETER: "none", UNIT: "none"}


@pytest.mark.slow
def test_a_gyroscope_takes_most_of_a_slowly_rocking_base_off_joint_one() -> None:
    case: Case = cases(Scope(quick=True))[0]
    found = responses(**case.arguments)
    at = FREQUENCIES.index(1.0)
    still, accelerometer, unit = (found["response"][name][at] for name in (NONE, ACCELEROMETER, UNIT))
    assert unit < accelerometer < still
    assert all(size == 0.0 for by in found["unstable"].values() for size in by[NONE])
