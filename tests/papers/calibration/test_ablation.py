import numpy as np
from numpy.testing import assert_allclose

from catenary import MotionLog
from catenary.calibration.fit_options import FitOptions
from papers.calibration import ablation
from papers.calibration.ablation import ALL, BOTH, FEATURES, FURTHER, MODELS, POSITIONS, SHUFFLED, TORQUES
from papers.calibration.recordings import fitted
from papers.experiment import Outcomes, Scope

ERRORS = {POSITIONS: [0.3, 0.3, 0.3], TORQUES: [0.5, 0.5, 0.2], BOTH: [0.1, 0.1, 0.1], ALL: [0.7, 0.7, 0.4]}


def outcomes(errors: dict[str, list[float]], further: float) -> Outcomes:
    """Make up errors of features, and of all with one more group."""
    return Outcomes(
        {
            case: {
                **{model: errors.get(case.arguments["features"], [further] * 3) for model in MODELS},
                "inputs": 16,
                "shuffled": {model: {name: [0.2, 0.3, 0.4] for name in SHUFFLED} for model in MODELS},
            }
            for case in ablation.cases(Scope(robots=(None, 1)))
        }
    )


def test_the_papers_conclusions_hold_for_errors_that_show_them_and_not_for_their_contrary() -> None:
    shown = outcomes(ERRORS, 0.1)
    assert {claim.judge(shown).verdict for claim in ablation.CLAIMS} == {"reproduced"}
    contrary = outcomes({**ERRORS, BOTH: [0.8] * 3, POSITIONS: [0.5, 0.5, 0.1], TORQUES: [0.3] * 3}, 0.1)
    assert {claim.judge(contrary).verdict for claim in ablation.CLAIMS} == {"not reproduced"}
    assert {claim.judge(Outcomes({})).verdict for claim in ablation.CLAIMS} == {"not measured"}


def test_what_holds_on_joints_1_and_2_does_not_carry_what_is_said_of_joint_3() -> None:
    made = outcomes({**ERRORS, TORQUES: [0.5, 0.5, 0.4]}, 0.1)
    told = {claim.says: claim.judge(made).verdict for claim in ablation.CLAIMS}
    assert (
        told["Joint 3 is the only joint in which torques are more important than positions"]
        == "not reproduced"
    )


def test_torques_that_add_little_to_positions_are_not_important() -> None:
    made = outcomes({**ERRORS, POSITIONS: [0.103, 0.103, 0.3]}, 0.1)
    told = {claim.says: claim.judge(made).verdict for claim in ablation.CLAIMS}
    assert told["Joint positions and motor torques are important to the calibration"] == "not reproduced"


def test_report_has_a_row_per_choice_of_features_and_per_signal_that_is_shuffled() -> None:
    report = ablation.report(outcomes(ERRORS, 0.1))
    assert [len(one.table.rows) for one in report.tables] == [len(FEATURES), len(SHUFFLED)]
    assert report.tables[1].table.rows[0][1] == "2.00 ± 0.00"  # 0.2 of 0.1


def test_groups_share_no_signal_and_leave_out_status_and_the_other_arm_only() -> None:
    further = [set(FEATURES[f"+ {name}"]) - set(FEATURES[BOTH]) for name in FURTHER]
    assert all(further)
    assert sum(len(one) for one in further) == len(set.union(*further))
    left = {name.partition(":")[0] for name in set(FEATURES[ALL]).difference(*further)} - {"q", "tau"}
    status = {"runlevel", "sublevel", "last_seq", "type", "grasp_d", "dt"}
    assert left == status | {"green_jpos", "green_tau"}


def test_shuffling_hurts_by_what_a_model_makes_of_a_signal_and_no_other_joint() -> None:
    rng = np.random.default_rng(0)
    q, told = rng.uniform(-1.0, 1.0, (4000, 3)), rng.uniform(-1.0, 1.0, 4000)
    truth = q.copy()
    truth[:, 2] += 0.001 * told  # [m] on the third joint alone
    log = MotionLog(
        "made up", ("shoulder", "elbow", "insertion"), ("rad", "rad", "m"), q, np.ones(4000, bool), truth,
        signals={"x": told}, signal_units={"x": "rad"},
    )  # fmt: skip
    model = fitted([log], FitOptions("linear", inputs=("q", "x")))
    assert_allclose(ablation.errors_left(model, log), 0.0, atol=1e-9)
    shuffled = ablation.errors_left(model, log, shuffle="x")
    # two independent uniform variables: 1 mm times sqrt(2 / 3)
    assert_allclose(shuffled, [0.0, 0.0, np.sqrt(2.0 / 3.0)], atol=0.03)
