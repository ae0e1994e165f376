import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import joint_friction, known_loads
from catenary.dynamics.external_torque import ExternalTorque, MomentumObserver, external_torque, external_wrench
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.kinematics import jacobian
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.robots.mjcf import load_mjcf

DOWN = np.array([0.0, 0.0, -9.81])
ROD = '<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="2"/>'
ARM = f"""<mujoco><option timestep="0.001"/><worldbody><body name="a" pos="0 0 1"><joint name="j1" axis="0 0 1" armature="0.2"
damping="0.4"/>{ROD}<body name="b" pos="0.3 0 0"><joint name="j2" axis="0 1 0" armature="0.1" damping="0.2"/>{ROD}
<body name="c" pos="0.3 0 0"><joint name="j3" axis="0 1 0" damping="0.1"/>{ROD}</body></body></body></worldbody></mujoco>"""
FORCE = np.array([4.0, -6.0, 9.0])
PUSHED = (300, 900)  # steps


def pushed_arm(tmp_path):
    """Return the arm, and what MuJoCo did with it on a moving reference while a hand pushed its last link."""
    (tmp_path / "arm.xml").write_text(ARM)
    ours, model = load_mjcf(tmp_path / "arm.xml"), mujoco.MjModel.from_xml_string(ARM)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, rows = mujoco.MjData(model), []
    for step in range(1200):
        wanted = 0.4 * np.sin(2.0 * np.pi * 0.001 * step * np.array([0.6, 0.8, 1.1]))
        data.qfrc_applied[:] = 80.0 * (wanted - data.qpos) - 8.0 * data.qvel
        data.xfrc_applied[3, :3] = FORCE if PUSHED[0] <= step < PUSHED[1] else 0.0
        mujoco.mj_forward(model, data)
        body = data.xipos[3].copy()
        J = np.zeros((3, 3))
        mujoco.mj_jac(model, data, J, None, body, 3)
        asked = J.T @ data.xfrc_applied[3, :3]
        rows.append((data.qpos.copy(), data.qvel.copy(), data.qacc.copy(), data.qfrc_applied.copy(), asked))
        mujoco.mj_step(model, data)
    return ours, [np.array(column) for column in zip(*rows, strict=True)]


def test_a_push_in_mujoco_is_what_torques_leave_and_what_momentum_shows(tmp_path):
    arm, (q, qd, qdd, tau, asked) = pushed_arm(tmp_path)
    loads = known_loads(arm)
    found = external_torque(arm, q, qd, qdd, tau, DOWN, deviation=0.1, loads=loads)
    assert_allclose(found.torque, asked, atol=1e-9)
    assert_allclose(found.half_width, 0.196)
    observer = MomentumObserver(arm, cutoff_hz=20.0, loads=loads)
    shown = np.array([observer.update(*row, DOWN, 0.001) for row in zip(q, qd, tau, strict=True)])
    settled = np.r_[150:300, 400:900, 1000:1200]  # 100 ms are 12 time constants
    assert_allclose(shown[settled], asked[settled], atol=0.12)  # lags 8 ms behind what changes by some 10 Nm/s
    half = shown[308] / asked[308]
    assert_allclose(half, 1.0 - np.exp(-1.0), atol=0.06)  # a time constant of 8 ms after the push began


def test_what_an_observer_learns_of_free_motion_tells_a_push_by_joint_and_no_friction(tmp_path, rng):
    arm, (q, qd, _, tau, asked) = pushed_arm(tmp_path)
    noisy = tau + 0.2 * rng.normal(size=tau.shape)
    observer = MomentumObserver(arm, loads=known_loads(arm))
    assert not observer.collided
    free = np.r_[900:1200]
    with pytest.raises(InputError, match="more than five time constants"):
        observer.learn(q[:50], qd[:50], noisy[:50], DOWN, 0.001)
    observer.learn(q[free], qd[free], noisy[free], DOWN, 0.001)
    assert (observer.deviation < 0.2).all()
    told = []
    for row in zip(q, qd, noisy, strict=True):
        observer.update(*row, DOWN, 0.001)
        told.append(observer.collided)
    first = next(k for k, joints in enumerate(told) if joints)
    assert PUSHED[0] <= first < PUSHED[0] + 50
    assert told[first][0] in [arm.joint_names[k] for k in np.argsort(-np.abs(asked[400]))[:2]]
    assert not any(told[: PUSHED[0]])


def test_dry_friction_of_a_joint_that_turns_back_is_no_collision():
    arm = load_robot("two_link")
    loads = joint_friction(arm, 2.0, 0.1)
    observer = MomentumObserver(arm, loads=loads, deviation=0.05)
    for k in range(4000):
        t = 0.001 * k
        q, qd, qdd = np.full(2, 0.05 * np.sin(t)), np.full(2, 0.05 * np.cos(t)), np.full(2, -0.05 * np.sin(t))
        stuck = 2.0 * np.tanh((qd - 0.002) / 0.001) + 0.1 * qd  # speeds are measured with an offset
        observer.update(q, qd, inverse_dynamics(arm, q, qd, qdd, DOWN) + stuck, DOWN, 0.001)
        assert not observer.collided, t


def test_a_wrench_is_told_by_six_joints_with_its_interval(rng):
    arm, q = load_robot("ur10e"), np.array([0.1, -1.2, 1.4, -0.5, 0.7, 0.2])
    wrench = np.array([10.0, -20.0, 5.0, 1.0, 0.5, -2.0])
    J, width = jacobian(arm, q, "tool0"), np.array([3.0, 3.0, 2.0, 1.0, 1.0, 0.5])
    found = external_wrench(arm, q, ExternalTorque(J.T @ wrench, width), "tool0")
    assert_allclose(found.wrench, wrench, atol=1e-9)
    noisy = [
        external_wrench(arm, q, ExternalTorque(J.T @ wrench + rng.normal(0, width / 1.96), width), "tool0").wrench
        for _ in range(400)
    ]
    inside = np.mean(np.abs(np.array(noisy) - wrench) < found.half_width, axis=0)
    assert (np.abs(inside - 0.95) < 0.04).all()  # 400 draws tell 95 % to 1 %


def test_what_an_arm_cannot_tell_is_not_a_number():
    planar = load_robot("planar_3r")
    found = external_wrench(planar, [0.3, 0.5, -0.4], ExternalTorque(np.ones(3), np.ones(3)))
    told = np.isfinite(found.wrench)
    assert told.sum() == 3  # two forces in its plane and the moment across
    assert_allclose((jacobian(planar, [0.3, 0.5, -0.4]).T[:, told]) @ found.wrench[told], np.ones(3), atol=1e-9)


def test_arguments_that_cannot_be_are_refused():
    arm = load_robot("two_link")
    zero = np.zeros(2)
    with pytest.raises(InputError, match="deviation"):
        external_torque(arm, zero, zero, zero, zero, DOWN, deviation=-1.0)
    with pytest.raises(InputError, match="cutoff_hz"):
        MomentumObserver(arm, cutoff_hz=0.0)
    for dt in (0.0, -0.001, np.nan):
        with pytest.raises(InputError, match="dt"):
            MomentumObserver(arm).update(zero, zero, zero, DOWN, dt)
