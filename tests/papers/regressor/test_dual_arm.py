import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, Reference, gravity_torque, load_robot
from papers.regressor import dual_arm
from papers.regressor.dual_arm_page import verdict, write_results

UPRIGHT = np.array([0.0, 0.0, -9.81])
SHORT = (dual_arm.Move(0.1, 0.6, 0.1 * dual_arm.ESTIMATION),)
SECONDS = 1.6


def rms(values: np.ndarray) -> list[float]:
    return [float(np.sqrt(np.mean(values[..., joints] ** 2))) for joints in dual_arm.LIMBS.values()]


def test_poses_lie_within_the_joint_limits() -> None:
    model = load_robot("dual_arm_19")
    for pose in (dual_arm.HOME, dual_arm.ESTIMATION, dual_arm.ONE, dual_arm.TWO):
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


@pytest.mark.slow
def test_pd_alone_sags_by_gravity_over_stiffness_and_learning_takes_it_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr(dual_arm, "ESTIMATED", (0.6, SECONDS))
    sag = dual_arm.run(dual_arm.Case("pd"), SHORT, duration=SECONDS)[-1]
    held = gravity_torque(load_robot("dual_arm_19"), SHORT[0].goal - sag, UPRIGHT)
    assert_allclose(sag, held / dual_arm.KP, atol=1e-6)  # 1 s after the motion
    for controller in ("law", "rls", "printed-compact", "printed-full"):
        left = dual_arm.run(dual_arm.Case(controller), SHORT, duration=SECONDS)[-200:]
        assert (np.array(rms(left)) < 0.1 * np.array(rms(sag))).all(), controller


def test_as_printed_it_learns_from_7_to_12_s_only_and_does_not_know_the_desired_velocity() -> None:
    model = load_robot("dual_arm_19")
    controller = dual_arm.controller_of(dual_arm.Case("printed-compact", "wrong"), model)
    rest, still = Reference(dual_arm.ONE, np.zeros(19), np.zeros(19)), np.zeros(19)
    moving = Reference(dual_arm.ONE, np.ones(19), np.zeros(19))
    known = []
    for time in (6.8, 6.9, 7.0, 7.1, 11.9, 12.0, 12.1):
        state = JointState(time, dual_arm.ONE - 0.01, still, still, still, UPRIGHT, 0.0)
        tau = controller.torque(state, rest)
        known.append(tau - 0.01 * dual_arm.KP)
        assert_allclose(controller.torque(state, moving), tau)
    assert_allclose(known[1], known[0])
    assert np.abs(known[3] - known[1]).max() > 0.1
    assert_allclose(known[6], known[5])
    start = gravity_torque(model, dual_arm.ONE - 0.01, UPRIGHT)
    assert np.abs(known[0] - start).max() > 0.1  # of the wrong parameters


def errors(scale: float) -> np.ndarray:
    return np.full((31001, 19), np.deg2rad(scale))


def test_every_case_is_measured_against_pd_alone_under_its_own_load(tmp_path: Path) -> None:
    runs = {case: errors(0.04 if case.controller == "rls" else 0.5) for case in dual_arm.CASES}
    runs[dual_arm.Case("pd", payload=True)] = errors(2.0)
    summaries = {s.case: s for s in dual_arm.summarise(runs)}
    assert_allclose(summaries[dual_arm.Case("pd")].rms["homing"]["trunk"], 0.5)
    assert summaries[dual_arm.Case("pd")].reached is None
    assert summaries[dual_arm.Case("rls")].reached
    assert summaries[dual_arm.Case("law")].reached is False
    assert_allclose(summaries[dual_arm.Case("law", payload=True)].ratio["homing"]["left arm"], 0.25)
    assert "least squares, from zero: reached" in verdict([summaries[dual_arm.Case("rls")]])


@pytest.mark.slow
def test_results_are_written_with_a_picture_of_every_run(tmp_path: Path) -> None:
    runs = {case: errors(0.5) for case in dual_arm.CASES}
    write_results(tmp_path, runs, dual_arm.summarise(runs))
    content = json.loads((tmp_path / "dual_arm.json").read_text())
    assert content["simulated"] is True
    assert [case["controller"] for case in content["cases"]] == [case.controller for case in dual_arm.CASES]
    assert set(content["cases"][0]["rms_deg"]) == set(dual_arm.WINDOWS)
    assert (tmp_path / "dual_arm.html").read_text().count("data:image/png") == len(dual_arm.CASES)
