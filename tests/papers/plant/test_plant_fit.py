"""The fit of the simulated RAVEN-II to the papers' results."""

import shutil
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary import JointState, Reference, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.simulation.simulated_plant import PERIOD
from catenary.spatial import LEVEL
from papers.calibration import recordings
from papers.gravity.raven_base import turned_base
from papers.plant import evaluation, reached, refit, targets
from papers.plant.evaluation import Hour
from papers.plant.pd_share import HOLD, LOOKED_AT, MOVE, POSES_DEG, HeldTool, PDShare, pd_share, poses_of_joint_1
from papers.plant.refit import fit_drift, fit_friction, fit_table_1, write_arm

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


def test_only_numbers_marked_as_fitted_are_free() -> None:
    entries = load_cable_arm().file.cable
    assert {entries[free.field].origin for free in PARAMETERS} == {"fitted"}


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


def test_errors_that_depend_on_parameters_as_powers_are_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    start = load_cable_arm().cable
    wanted = np.array(targets.TARGETS["linear"])

    def errors(arm: CableArm) -> dict[str, Floats]:
        runout = arm.cable.capstan_runout / start.capstan_runout
        return {key: np.array(value) for key, value in targets.TARGETS.items()} | {"linear": 0.85 * wanted * runout}

    monkeypatch.setattr(refit, "mean_errors", errors)
    factors = dict(zip(targets.FREE, fit_table_1(load_cable_arm(), 4), strict=True))
    runouts = [factor for free, factor in factors.items() if free.field == "capstan_runout"]
    assert_allclose(runouts, 1.0 / 0.85, rtol=0.03)  # as near as the fit goes
    assert_allclose([f for free, f in factors.items() if free.field != "capstan_runout"], 1.0, rtol=1e-6)


def test_rates_of_set_follow_the_last_hour_through_the_coupling(monkeypatch: pytest.MonkeyPatch) -> None:
    start, spread = load_cable_arm().cable.set_rate, np.array([0.17, 0.19, 0.17])

    def six_hours(arm: CableArm) -> tuple[Hour, Hour]:
        rate = arm.cable.set_rate / start
        shift = np.array([0.3, 0.4, 0.05]) * rate + np.array([0.0, 0.05, 0.03]) * rate[0]
        last = Hour(np.hypot(spread, shift), spread, shift)
        return last, last

    monkeypatch.setattr(refit, "six_hours", six_hours)
    arm = targets.with_factors(load_cable_arm(), targets.DRIFT, fit_drift(load_cable_arm()))
    assert_allclose(six_hours(arm)[1].linear, targets.LAST_HOUR, rtol=0.03)


def test_what_is_within_15_percent_is_reached() -> None:
    assert reached.verdict((1.1, 1.9, 3.0), (1.0, 2.0, 3.0)) == "reached"


def test_what_is_not_reached_is_named_with_how_far_it_is_off() -> None:
    assert reached.verdict((1.5, 2.0, 1.5), (1.0, 2.0, 3.0)) == "J1 +50%, J3 -50%"


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


@pytest.mark.slow
def test_on_a_tilted_base_sensed_gravity_spares_pd_and_level_gravity_does_not() -> None:
    sensed, level = (pd_share(ARM, 25.0, sensed=sensed).share[0] for sensed in (True, False))
    assert sensed < 15.0
    assert level > 40.0
