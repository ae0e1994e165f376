import pytest

from papers.experiment import NOMINAL, Outcomes, Result, Scope
from papers.gravity.passive import (
    ANGLES_DEG,
    CLAIMS,
    as_rigid_bodies,
    cases,
    neutral,
    on_cables,
    report,
    rocked,
)


def made_one(told: dict[str, float], dg: float = 0.0, sg_per_deg: float = 1.0) -> Result:
    """Drift of every joint: with DG the same at each base, with SG by the base's angle."""
    return {
        "dg": [dg] * 3,
        "dg-imu": [0.5 * dg] * 3,
        "sg": [sg_per_deg * abs(told.get("angle_deg", 15.0))] * 3,
        "missing": [0.0] * 3,
        "distance": 1e-9,
        "energy": 1.0,
    }


def made_up(dg: float, sg_per_deg: float) -> Outcomes:
    return Outcomes(
        {case: made_one(case.arguments, dg, sg_per_deg) for case in cases(Scope(robots=(NOMINAL, 1)))}
    )


@pytest.mark.parametrize(
    ("dg", "sg_per_deg", "expected"),
    [
        (0.0, 1.0, ["reproduced", "reproduced"]),
        (2.0, 0.0, ["not reproduced", "not reproduced"]),
        # from 20 deg on only
        (0.0, 0.06, ["reproduced", "same direction"]),
    ],
)
def test_an_arm_that_stays_with_dg_and_falls_with_sg_is_the_papers(
    dg: float, sg_per_deg: float, expected: list[str]
) -> None:
    assert [claim.judge(made_up(dg, sg_per_deg)).verdict for claim in CLAIMS] == expected


def test_where_some_robots_stay_their_number_is_told() -> None:
    stayed = on_cables.case(seed=1, angle_deg=-10, seconds=10.0)
    results = {case: made_one(case.arguments) for case in cases(Scope(robots=(NOMINAL, 1)))}
    results[stayed] = {**results[stayed], "sg": [0.0] * 3}
    judged = CLAIMS[1].judge(Outcomes(results))
    assert judged.verdict == "same direction"
    assert judged.measured == (
        "every robot drifts at 14 of 15 angles, by 10.0 at least; "
        "at -10 deg 5.0 ± 7.1 (deg or mm), 1 of 2 robots (15 of 16)"
    )
    assert CLAIMS[1].judge(made_up(0.0, 1.0)).verdict == "reproduced"


def test_drift_is_told_with_its_spread_over_robots() -> None:
    results = {case: made_one(case.arguments) for case in cases(Scope(robots=(NOMINAL, 1)))}
    one = on_cables.case(seed=1, angle_deg=45, seconds=10.0)
    results[one] = {**results[one], "dg": [0.2, 0.0, 0.0]}
    measured = CLAIMS[0].judge(Outcomes(results)).measured
    assert measured.startswith(
        "each robot's largest drift at any angle: J1 0.100 ± 0.141 deg, J2 0.000 ± 0.000 deg"
    )
    assert "at most 0.20 deg" in measured


def test_report_has_a_row_for_every_base() -> None:
    shown = report(made_up(0.0, 1.0))
    assert [len(table.rows) for _, table in shown.tables] == [*[len(ANGLES_DEG)] * 3, 6]
    assert shown.tables[3].table.rows[-1] == ["1 Hz", "level base", *["15.0 ± 0.0"] * 3]
    assert shown.tables[0].table.rows[-1][:5] == ["180", *["0.000 ± 0.000"] * 3, "180.0 ± 0.0"]
    assert report(Outcomes({})).tables == []
    assert [claim.judge(Outcomes({})).verdict for claim in CLAIMS] == ["not measured"] * 2


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [25, 180])
def test_without_friction_sensed_gravity_holds_and_nominal_one_does_not(angle_deg: int) -> None:
    held = as_rigid_bodies(angle_deg=angle_deg, seconds=1.0)
    assert max(held["dg"]) < 1e-3  # deg, mm: a torque of rounding alone
    # nothing sticks: on the same plant, from the same rest, half a second under a hundredth of a
    # joint's load moves it by more than that
    assert min(held["sg"]) > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [0, 25, 90, 180])
def test_with_sensed_gravity_every_pose_is_a_neutral_equilibrium(angle_deg: int) -> None:
    at = neutral(angle_deg=angle_deg, seconds=1.0)
    # gravity that were not cancelled would take a joint off by many times its displacement, or back past where it was
    assert at["distance"] < 1e-3
    # torques are held for a millisecond, and their changes late by that
    assert at["energy"] == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_on_a_rocking_base_rates_keep_what_gravity_alone_lets_creep() -> None:
    crept = {name: drift[0] for name, drift in rocked(seed=None, hz=1.0, seconds=1.5).items()}
    assert crept["dg-imu"] < crept["dg"] < crept["sg"]


@pytest.mark.slow
def test_simulated_raven_holds_upside_down_with_sensed_gravity_alone() -> None:
    held = on_cables(seed=None, angle_deg=180, seconds=1.0)
    assert max(held["dg"][:2]) < 0.1  # the accelerometer's noise moves nothing that friction holds
    assert held["sg"][0] > 5.0
