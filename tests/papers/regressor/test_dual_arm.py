import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, Reference, gravity_torque, load_robot
from papers.experiment import Outcomes, Scope
from papers.regressor import dual_arm, figure_4, figure_5
from papers.regressor.dual_arm_tables import LEARNT, RESTS, Condition, rms, share

UPRIGHT = np.array([0.0, 0.0, -9.81])
SHORT = (dual_arm.Move(0.1, 0.6, 0.1 * dual_arm.LEARNING),)
SECONDS = 1.6


def limbs(values: np.ndarray) -> list[float]:
    return [float(np.sqrt(np.mean(values[..., joints] ** 2))) for joints in dual_arm.LIMBS.values()]


def test_poses_lie_within_the_joint_limits() -> None:
    model = load_robot("dual_arm_19")
    for pose in (dual_arm.HOME, dual_arm.LEARNING, dual_arm.ONE, dual_arm.TWO):
        assert ((model.lower < pose) & (pose < model.upper)).all()


def test_motion_keeps_the_papers_times() -> None:
    motion = dual_arm.trajectory()
    assert_allclose(motion.duration, 31.0)
    for move, before in zip(
        dual_arm.TIMELINE, (dual_arm.HOME, *(m.goal for m in dual_arm.TIMELINE[:-1])), strict=True
    ):
        assert_allclose(motion(move.begin).q, before, atol=1e-12)
        assert_allclose(motion(move.end).q, move.goal, atol=1e-12)
        assert np.abs(motion(move.begin + 0.1).q - before).max() > 0.0


def test_drawn_robots_differ_within_the_stated_shares_in_mass_alone() -> None:
    nominal, drawn = dual_arm.robot(None).tree, dual_arm.robot(3).tree
    heavier = drawn.mass / nominal.mass
    assert heavier.min() >= 0.7
    assert heavier.max() <= 1.3
    assert heavier.std() > 0.05
    assert_allclose(np.linalg.norm(drawn.com, axis=1), np.linalg.norm(nominal.com, axis=1), rtol=0.2001)
    assert_allclose(drawn.origin, nominal.origin)
    assert_allclose(dual_arm.robot(3).tree.mass, drawn.mass)


@pytest.mark.slow
def test_pd_alone_sags_by_gravity_over_stiffness_and_learning_takes_it_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr(dual_arm, "ESTIMATION", (0.6, SECONDS))
    sag = dual_arm.errors_of(None, "pd", "zero", 0.0, timeline=SHORT, duration=SECONDS)[-1]
    held = gravity_torque(load_robot("dual_arm_19"), SHORT[0].goal - sag, UPRIGHT)
    assert_allclose(sag, held / dual_arm.KP, atol=1e-6)  # 1 s after the motion
    for controller in ("law", "rls", "printed-compact", "printed-full"):
        left = dual_arm.errors_of(None, controller, "zero", 0.0, timeline=SHORT, duration=SECONDS)[-200:]
        assert (np.array(limbs(left)) < 0.1 * np.array(limbs(sag))).all(), controller


@pytest.mark.parametrize("controller", ["printed-compact", "printed-longer"])
def test_as_printed_it_learns_in_its_time_only_and_does_not_know_the_desired_velocity(
    controller: dual_arm.ControllerName,
) -> None:
    model = load_robot("dual_arm_19")
    law = dual_arm.controller_of(controller, "wrong", model)
    rest, still = Reference(dual_arm.ONE, np.zeros(19), np.zeros(19)), np.zeros(19)
    moving = Reference(dual_arm.ONE, np.ones(19), np.zeros(19))
    known = []
    for time in (6.8, 6.9, 7.0, 7.1, 11.9, 12.0, 12.1):
        state = JointState(time, dual_arm.ONE - 0.01, still, still, still, UPRIGHT, 0.0)
        tau = law.torque(state, rest)
        known.append(tau - 0.01 * dual_arm.KP)
        assert_allclose(law.torque(state, moving), tau)
    assert_allclose(known[1], known[0])
    assert np.abs(known[3] - known[1]).max() > 0.1
    assert np.allclose(known[6], known[5]) == (controller == "printed-compact")
    start = gravity_torque(model, dual_arm.ONE - 0.01, UPRIGHT)
    assert np.abs(known[0] - start).max() > 0.1  # of the wrong parameters


def made_up(levels: dict[str, float], *, before: float = 0.5) -> Outcomes:
    """Every window of a controller at one level, robots alike."""
    results = {}
    for case in [*figure_4.cases(Scope(robots=(None, 1))), *figure_5.cases(Scope(robots=(None, 1)))]:
        level = levels.get(case.arguments["controller"], 0.5)
        windows = {name: dict.fromkeys(dual_arm.LIMBS, level) for name in dual_arm.WINDOWS}
        windows["before estimation"] = dict.fromkeys(dual_arm.LIMBS, before)
        results[case] = {"rms_deg": windows, "errors_deg": np.full((19, 311), level).tolist()}
    return Outcomes(results)


def test_every_run_is_measured_against_pd_alone_with_its_own_damping_under_its_own_load() -> None:
    outcomes = made_up({"rls": 0.04, "printed-pd": 1.0, "printed-compact": 0.25})
    assert rms(outcomes, Condition("rls", payload_kg=2.0), LEARNT).shape == (2, 3)
    assert share(outcomes, Condition("rls"), LEARNT) == pytest.approx(0.08)
    assert share(outcomes, Condition("printed-compact"), RESTS[0]) == pytest.approx(0.25)
    report = figure_5.report(outcomes)
    assert "least squares, from zero: reached" in report.remarks[1]
    assert "law on the compact Z, from zero: not reached" in report.remarks[0]
    (printed, _) = figure_4.report(outcomes).tables
    assert len(printed.table.rows) == 3
    assert [len(one.table.rows) for one in report.tables] == [18, 5, 15, 4, 9, 2]
    assert len(report.pictures) == 3


def test_verdicts_of_figures_4_and_5() -> None:
    good = made_up({"printed-pd": 0.5, "printed-compact": 0.1, "printed-full": 0.1, "printed-longer": 0.05})
    assert [claim.judge(good).verdict for claim in figure_4.CLAIMS] == ["reproduced", "reproduced"]
    shrinks, some, beside, longer = (claim.judge(good).verdict for claim in figure_5.CLAIMS)
    assert (shrinks, beside, longer) == ("reproduced", "reproduced", "reproduced")
    assert some == "not reproduced"  # the same at the end of the estimation and after
    bad = made_up({"printed-pd": 0.5, "printed-compact": 0.6, "printed-full": 0.6, "printed-longer": 0.7})
    assert {claim.judge(bad).verdict for claim in figure_5.CLAIMS} == {"not reproduced"}
    assert figure_5.CLAIMS[0].judge(Outcomes({})).verdict == "not measured"


def test_what_is_measured_has_its_spread_over_robots() -> None:
    outcomes = made_up(
        {"printed-pd": 0.5, "printed-compact": 0.1, "printed-full": 0.1, "printed-longer": 0.05}
    )
    (case, first), *others = (
        (case, result)
        for case in figure_5.cases(Scope(robots=(None, 1)))
        for result in outcomes.of(dual_arm.dual_arm, **case.arguments)
    )
    windows = {name: dict.fromkeys(dual_arm.LIMBS, 0.7) for name in dual_arm.WINDOWS}
    varied = Outcomes({**dict(others), case: {**first, "rms_deg": windows}})
    assert case.arguments["controller"] == "printed-pd"
    stays, _ = (claim.judge(varied).measured for claim in figure_4.CLAIMS)
    assert stays.startswith("trunk 0.60 ± 0.14 to 0.60 ± 0.14 deg, left arm")
    shrinks, some, beside, longer = (claim.judge(varied).measured for claim in figure_5.CLAIMS)
    assert "law on the compact Z, from zero: 0.500 ± 0.000 to 0.100 ± 0.000 deg" in shrinks
    assert "law on the full Z, from zero, rest in pose two: 0.100 ± 0.000 deg" in some
    assert "law on the full Z, from zero, rest in pose one: 17 ± 4 %" in beside
    assert longer.startswith("mean of the limbs, rest in pose one: 0.100 ± 0.000 to 0.050 ± 0.000 deg")
