from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import load_cable_arm
from papers.experiment import Outcomes, Scope
from papers.gravity import joint_3
from papers.gravity.joint_3 import varied_joint_3


def outcomes(change: float) -> Outcomes:
    """Made-up errors: compensation changes joint 3's by a share."""
    scope = Scope(robots=(None,))
    return Outcomes(
        {
            case: {
                name: 2.0 if name == "pd" else 2.0 * (1.0 + change) for name in case.arguments["controllers"]
            }
            for case in joint_3.cases(scope)
        }
    )


def test_only_joint_3_is_varied() -> None:
    nominal = load_cable_arm().cable
    rough = varied_joint_3(4.0, 1.0).cable
    assert_allclose(rough.link_friction / nominal.link_friction, [1.0, 1.0, 4.0])
    assert_allclose(rough.coupling, nominal.coupling)
    wound = varied_joint_3(1.0, 0.7).cable
    # c01 is joint 2's
    assert_allclose(wound.coupling / nominal.coupling, [1.0, 0.7, 0.7])
    assert_allclose(wound.rotor_friction, nominal.rotor_friction)


def test_verdict_goes_with_the_sign_of_the_change() -> None:
    (claim,) = joint_3.CLAIMS
    assert claim.judge(outcomes(0.05)).verdict == "reproduced"
    assert claim.judge(outcomes(-0.05)).verdict == "not reproduced"
    assert claim.judge(Outcomes({})).verdict == "not measured"


def test_table_has_every_variation_with_either_damping() -> None:
    (table,) = joint_3.report(outcomes(-0.05)).tables
    assert len(table.table.rows) == 2 * len(joint_3.VARIATIONS)
    assert table.table.rows[0][1:] == ["2.0000", "-5.00", "-5.00"]
