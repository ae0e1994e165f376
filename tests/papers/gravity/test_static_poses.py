import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from papers.experiment import NOMINAL, Outcomes, Result, Scope
from papers.gravity import figure_7, figure_8
from papers.gravity.raven_base import turned_base
from papers.gravity.static_poses import ANGLES_DEG, HOME, cases, rms, static

SCOPE = Scope(robots=(NOMINAL, 1))


def made_up(*, sg_off_per_deg: float = 0.02, friction: float = 0.1) -> Outcomes:
    """PD holds 2 Nm; the DG term lacks friction, the SG term that and more on a tilted base; at six poses each."""

    def result(angle: float) -> Result:
        sg, dg = 2.0 - friction - sg_off_per_deg * angle, 2.0 - friction
        held = {"torque": [[2.0, 1.0, 1.0]] * 6, "error": [[0.1, 0.1, 0.1]] * 6}
        return {
            "pd": held | {"feedback": held["torque"], "sg": [[sg, 1.0, 1.0]] * 6, "dg": [[dg, 1.0, 1.0]] * 6},
            "sg": held | {"feedback": [[2.0 - sg, 0.5, 0.5]] * 6},
            "dg": held | {"feedback": [[2.0 - dg, 0.5, 0.5]] * 6},
        }

    return Outcomes({case: result(case.arguments["angle_deg"]) for case in cases(SCOPE)})


def verdicts(claims, outcomes: Outcomes) -> list[str]:
    return [claim.judge(outcomes).verdict for claim in claims]


def test_terms_that_match_and_one_that_diverges_are_reproduced() -> None:
    assert verdicts(figure_7.CLAIMS, made_up()) == ["reproduced"] * 3
    assert verdicts(figure_8.CLAIMS, made_up()) == ["reproduced"] * 3


def test_terms_that_are_alike_on_every_base_are_not() -> None:
    same = made_up(sg_off_per_deg=0.0)
    assert verdicts(figure_7.CLAIMS, same) == ["reproduced", "not reproduced", "not reproduced"]
    assert verdicts(figure_8.CLAIMS, same) == ["reproduced", "not reproduced", "not reproduced"]


def test_friction_of_a_fifth_is_no_match_but_near() -> None:
    rough = made_up(friction=0.4)
    assert verdicts(figure_7.CLAIMS, rough)[0] == "same direction"
    assert verdicts(figure_8.CLAIMS, rough)[0] == "not reproduced"


def test_reports_have_a_row_for_every_base_and_stand_without_any_case() -> None:
    shown = figure_7.report(made_up())
    assert [len(table.rows) for _, table in shown.tables] == [len(ANGLES_DEG)] * 2
    # joint 1 on a level base: 0.1 of 2 Nm
    assert shown.tables[0].table.rows[0][1:3] == ["5.0 ± 0.0", "5.0 ± 0.0"]
    assert len(shown.pictures[0].figure.axes) == 4
    shares = figure_8.report(made_up())
    assert [len(table.rows) for _, table in shares.tables] == [6, 18, 6, 18]
    assert shares.tables[0].table.rows[-1][1] == "30.0 ± 0.0"
    for figure in (figure_7, figure_8):
        assert figure.report(Outcomes({})).tables == []
        assert verdicts(figure.CLAIMS, Outcomes({})) == ["not measured"] * 3


def test_claims_are_of_joint_1_told_with_their_spread_and_what_friction_does_to_others() -> None:
    seventh, eighth = figure_7.report(made_up()), figure_8.report(made_up())
    assert "joint 2 by 0.0 ± 0.0 %" in seventh.remarks[0]
    assert "placed: joint 1 5.0 ± 0.0 %, joint 2 50.0 ± 0.0 %" in eighth.remarks[0]
    assert (
        figure_7.CLAIMS[2]
        .judge(made_up())
        .measured.startswith("SG off: 0 deg 5.0 ± 0.0 %, 5 deg 10.0 ± 0.0 %")
    )
    assert figure_8.CLAIMS[0].judge(made_up()).measured.startswith("PD+DG: 0 deg 5.0 ± 0.0 %")
    assert [claim.fitted for claim in (*figure_7.CLAIMS, *figure_8.CLAIMS)] == [True, False, False] * 2
    assert figure_7.report(Outcomes({})).remarks == figure_8.report(Outcomes({})).remarks == []


def run(approach: str, angle_deg: float, poses_deg: list[float]) -> Result:
    return static(seed=None, angle_deg=angle_deg, approach=approach, poses_deg=poses_deg)


@pytest.mark.slow
def test_placed_arm_needs_no_pd_with_sensed_gravity_and_much_with_nominal_one() -> None:
    tilted = run("placed", 25, [37.0])
    share = {name: rms(tilted[name]["feedback"])[0] / rms(tilted[name]["torque"])[0] for name in tilted}
    assert share["dg"] < 0.15
    assert share["sg"] > 0.40
    assert share["pd"] == pytest.approx(1.0)


@pytest.mark.slow
def test_on_a_level_base_nominal_gravity_is_the_sensed_one() -> None:
    level = run("placed", 0, [37.0])
    # 50 samples of 150 ug/sqrt(Hz) over 50 Hz, counts of 0.25 mg: 0.003 m/s2 at most in the mean, on 1.5 kg
    assert_allclose(level["sg"]["torque"], level["dg"]["torque"], atol=0.01)
    assert_allclose(level["pd"]["sg"], level["pd"]["dg"], atol=0.01)
    assert np.abs(np.subtract(level["pd"]["sg"], level["pd"]["dg"])).max() > 0.0  # a sensor has noise


@pytest.mark.slow
def test_driven_arm_leaves_its_friction_to_the_pd() -> None:
    tilted = run("driven", 25, [37.0])
    # 0.15 + 0.16 Nm and a tenth of the load, of 2 to 3 Nm
    assert abs(tilted["dg"]["feedback"][0][0]) < 0.25 * abs(tilted["dg"]["torque"][0][0])
    error = {name: abs(tilted[name]["error"][0][0]) for name in tilted}
    assert error["dg"] < error["sg"] < error["pd"]
    # the terms are those of the base's gravity at the pose, less what PD alone sags by
    gravity = turned_base(25).sample(np.zeros(1)).gravity[0]
    expected = gravity_torque(load_robot("raven2"), np.array([np.deg2rad(37.0), *HOME]), gravity)
    assert_allclose(tilted["pd"]["dg"][0], expected, rtol=0.02, atol=0.01)
