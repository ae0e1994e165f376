import numpy as np
import pytest

from papers.experiment import NOMINAL, Outcomes, Scope
from papers.gravity import own_compensation
from papers.gravity.own_compensation import ANGLES_DEG, DG, LAWS, LEVEL, PD, SG, TOLD, cases, held, report

SCOPE = Scope(robots=(NOMINAL, 1))


def made_up() -> Outcomes:
    """Errors of joint 1 as large as the law's place in the list and the base's angle, 0.1 deg more on robot 1."""
    return Outcomes(
        {
            case: {
                law: [k + case.arguments["angle_deg"] + 0.1 * (case.arguments["seed"] or 0), 0.5, 0.01]
                for k, law in enumerate(LAWS)
            }
            for case in cases(SCOPE)
        }
    )


def test_a_row_for_every_base_and_joint_and_a_column_for_every_law() -> None:
    shown = report(made_up())
    ((_, table),) = shown.tables
    assert table.header == ["base, joint", *LAWS]
    assert len(table.rows) == 3 * len(ANGLES_DEG)
    assert table.rows[0] == ["0 deg, J1 [deg]", *(f"{k + 0.05:.3f} ± 0.071" for k in range(5))]
    assert "25 deg joint 1 is off by 26.050 deg" in shown.remarks[0]
    assert len(shown.pictures[0].figure.axes) == 2


def test_part_of_the_cases_shows_as_far_as_it_goes() -> None:
    whole = made_up()
    first = dict(list(whole._results.items())[:1])
    assert len(report(Outcomes(first)).tables[0].table.rows) == 3
    assert report(Outcomes({})).remarks == []


@pytest.mark.slow
def test_told_where_gravity_is_it_holds_a_tilted_arm_and_untold_it_does_not() -> None:
    result = held(seed=None, angle_deg=25.0, poses_deg=[37.0])
    joint_1 = {law: result[law][0] for law in LAWS}
    assert joint_1[TOLD] < 0.5 * joint_1[LEVEL]
    assert joint_1[DG] < 0.5 * joint_1[SG]
    # gravity over stiffness, 0.5 to 2 Nm over 454 Nm/rad
    assert 0.05 < joint_1[PD] < 0.4
    assert all(np.isfinite(result[law]).all() for law in LAWS)
    assert own_compensation.EXPERIMENT.place == "beyond"
