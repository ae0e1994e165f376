import pytest

from papers.experiment import NOMINAL, Outcomes, Result, Scope
from papers.gravity.passive import ANGLES_DEG, CLAIMS, as_rigid_bodies, cases, neutral, on_cables, report


def made_up(dg: float, sg_per_deg: float) -> Outcomes:
    """Drift of every joint: with DG the same at each base, with SG by the base's angle."""

    def result(angle: float) -> Result:
        return {
            "dg": [dg] * 3,
            "sg": [sg_per_deg * abs(angle)] * 3,
            "missing": [0.0] * 3,
            "distance": 1e-9,
            "energy": 1.0,
        }

    return Outcomes({case: result(case.arguments["angle_deg"]) for case in cases(Scope(robots=(NOMINAL, 1)))})


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


def test_report_has_a_row_for_every_base() -> None:
    shown = report(made_up(0.0, 1.0))
    assert [len(table.rows) for _, table in shown.tables] == [len(ANGLES_DEG)] * 3
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
def test_simulated_raven_holds_upside_down_with_sensed_gravity_alone() -> None:
    held = on_cables(seed=None, angle_deg=180, seconds=1.0)
    assert max(held["dg"][:2]) < 0.1  # the accelerometer's noise moves nothing that friction holds
    assert held["sg"][0] > 5.0
