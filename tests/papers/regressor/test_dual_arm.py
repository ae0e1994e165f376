import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import JointState, Reference, gravity_torque, load_robot
from papers.regressor import dual_arm

UPRIGHT = np.array([0.0, 0.0, -9.81])
SHORT = (dual_arm.Move(0.1, 0.6, 0.1 * dual_arm.LEARNING),)
SECONDS = 1.6


def limbs(values: np.ndarray) -> list[float]:
    return [float(np.sqrt(np.mean(values[..., joints] ** 2))) for joints in dual_arm.LIMBS.values()]


def test_motion_keeps_the_papers_times() -> None:
    motion = dual_arm.trajectory()
    assert_allclose(motion.duration, 31.0)
    for move, before in zip(dual_arm.TIMELINE, (dual_arm.HOME, *(m.goal for m in dual_arm.TIMELINE[:-1])), strict=True):
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
def test_pd_alone_sags_by_gravity_over_stiffness_and_learning_takes_it_away(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr(dual_arm, "ESTIMATION", (0.6, SECONDS))
    sag = dual_arm.errors_of(None, "pd", "zero", 0.0, timeline=SHORT, duration=SECONDS)[-1]
    held = gravity_torque(load_robot("dual_arm_19"), SHORT[0].goal - sag, UPRIGHT)
    assert_allclose(sag, held / dual_arm.KP, atol=1e-6)  # 1 s after the motion
    for controller in ("law", "rls", "printed-compact", "printed-full"):
        left = dual_arm.errors_of(None, controller, "zero", 0.0, timeline=SHORT, duration=SECONDS)[-200:]
        assert (np.array(limbs(left)) < 0.1 * np.array(limbs(sag))).all(), controller


@pytest.mark.parametrize("controller", ["printed-compact", "printed-longer", "printed-moving"])
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
    assert (np.abs(known[3] - known[1]).max() > 0.1) == (controller != "printed-moving")
    assert np.allclose(known[6], known[5]) == (controller == "printed-compact")
    start = gravity_torque(model, dual_arm.ONE - 0.01, UPRIGHT)
    assert np.abs(known[0] - start).max() > 0.1  # of the wrong parameters
