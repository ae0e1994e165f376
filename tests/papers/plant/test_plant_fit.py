"""The fit of the simulated RAVEN-II to the papers' results."""

import shutil
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary import JointState, Reference, gravity_torque, load_robot
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.simulation.simulated_plant import PERIOD
from catenary.spatial import LEVEL
from papers.calibration import recordings
from papers.gravity.raven_base import turned_base
from papers.plant import evaluation, refit, targets
from papers.plant.pd_share import HOLD, LOOKED_AT, MOVE, POSES_DEG, HeldTool, PDShare, poses_of_joint_1
from papers.plant.refit import fit_friction, write_arm

PARAMETERS = (*targets.FREE, *targets.FRICTION, *targets.DRIFT)


def test_fitted_numbers_are_written_and_everything_else_stays(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    with as_file(files("catenary.simulation") / "data" / "raven2.toml") as packaged:
        shutil.copy(packaged, path)
    before = load_cable_arm(path)
    factors = np.linspace(0.9, 1.1, len(PARAMETERS))
    write_arm(targets.with_factors(before, PARAMETERS, factors), path)
    after = load_cable_arm(path)
    for free, factor in zip(PARAMETERS, factors, strict=True):
        old, new = getattr(before.cable, free.field), getattr(after.cable, free.field)
        assert_allclose(new[free.joint], factor * old[free.joint], rtol=1e-5)  # six digits are written
    for name in set(before.cable.fields) - targets.FITTED:
        assert_allclose(getattr(after.cable, name), getattr(before.cable, name), rtol=0)
    origins = [[entry.origin for entry in arm.file.cable.values()] for arm in (after, before)]
    assert origins[0] == origins[1]


def test_one_factor_moves_all_of_a_group() -> None:
    arm = load_cable_arm()
    halved = targets.with_factors(arm, targets.FRICTION, np.array([0.5])).cable
    assert_allclose(halved.rotor_friction, 0.5 * arm.cable.rotor_friction)
    assert_allclose(halved.link_friction, arm.cable.link_friction * [0.5, 1.0, 1.0])


def test_friction_of_joint_1_grows_with_its_torque() -> None:
    arm = load_cable_arm()
    c = arm.cable
    share = c.rotor_load_friction[0] + c.link_load_friction[0]
    assert_allclose(targets.joint_1_friction(arm, 2.0) - targets.joint_1_friction(arm, 0.0), 2.0 * share)


def test_friction_follows_the_share_of_pd(monkeypatch: pytest.MonkeyPatch) -> None:
    start = load_cable_arm().cable.rotor_friction[0]

    def share(arm: CableArm, base_deg: float, *, sensed: bool) -> PDShare:
        # of a robot with too much friction
        more = 1.3 * targets.PD_SHARE * (arm.cable.rotor_friction[0] / start) ** 0.6
        return PDShare(np.full(3, more), np.ones(3), np.ones(3))

    monkeypatch.setattr(refit, "pd_share", share)
    assert_allclose(fit_friction(load_cable_arm()), 1.3 ** (-1.0 / 0.6), rtol=0.06)  # 3 % of the share


def test_every_direction_is_tested_on_the_same_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, seen = {}, []

    def record(plant: object, motion: object, name: str, rng: np.random.Generator, **_: object) -> None:
        if name == "zigzag":
            rng.random(round(motion.duration))  # type: ignore[attr-defined]  # jitter of the stamps: longer paths draw more
        seen.append(motion)

    monkeypatch.setattr(recordings, "record_simulated", record)
    for direction in ("J1", "J2-J3", "J1-J2-J3"):
        evaluation.recordings(None, direction)  # type: ignore[arg-type]
        drawn[direction] = seen[-1].sample(np.linspace(0.0, 1200.0, 50))[0]
    assert_array_equal(drawn["J1"], drawn["J2-J3"])
    assert_array_equal(drawn["J1"], drawn["J1-J2-J3"])


ARM = load_cable_arm()


HOME = np.append(np.array([0.5, 1.5, 0.4]), np.zeros(4))


TILTED = turned_base(25.0).sample(np.zeros(1)).gravity[0]


def _state(gravity: np.ndarray) -> JointState:
    return JointState(0.0, HOME, np.zeros(7), np.zeros(7), np.zeros(7), gravity, 0.0)


@pytest.mark.parametrize(("sensed", "gravity"), [(True, TILTED), (False, LEVEL)])
def test_without_error_the_torque_is_that_of_believed_gravity(sensed: bool, gravity: np.ndarray) -> None:
    controller = HeldTool(ARM.firmware, sensed=sensed)
    tau = controller.torque(_state(TILTED), Reference(HOME, np.zeros(7), np.zeros(7)))
    assert_allclose(tau[:3], gravity_torque(load_robot("raven2"), HOME[:3], gravity))
    assert_allclose(controller.feedback, 0.0)


def test_the_arm_rests_while_it_is_looked_at() -> None:
    path = poses_of_joint_1(HOME)
    for k, pose in enumerate(POSES_DEG):
        end = (k + 1) * (MOVE + HOLD)
        for t in (end - LOOKED_AT, end - PERIOD):
            q, qd, _ = path(t)
            assert_allclose(q[0], np.deg2rad(pose))
            assert_allclose(qd, 0.0, atol=1e-12)
