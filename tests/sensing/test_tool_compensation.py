import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.kernels.tracing import evaluate_line
from catenary.sensing.tool_compensation import JointMotion, ToolCompensation, tool_line
from catenary.spatial import LEVEL
from oracles.sensed_tool import ARM, POSE, SensedTool

RATE = 500.0  # [Hz] of sensor and joints


def moved(wrist: SensedTool, compensation: ToolCompensation, seconds: float, push=lambda t: np.zeros(6), at=None):
    """Move all joints at once; return times, wrenches and their deviations, or hold them at a time."""
    rows, wait, ahead = [], compensation.motion.wait, 0
    for i in range(round(seconds * RATE)):
        t = i / RATE
        while ahead / RATE <= t + wait:
            when = ahead / RATE
            compensation.motion.put(when, *(wrist.joints(when) if at is None else (at, 0.0 * at)))
            ahead += 1
        motion = wrist.motion(t) if at is None else (at, 0.0 * at, 0.0 * at)
        rows.append((t, *compensation.update(t, wrist.reads(wrist.load(*motion) + push(t), t), LEVEL)))
    return [np.array(column) for column in zip(*rows, strict=True)]


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_a_weighed_tool_leaves_little_but_the_sensors_noise_at_one_radian_per_second(seed):
    wrist = SensedTool(seed)
    tool, doubts = wrist.weighed().weigh()
    assert doubts == []
    assert tool.mass == pytest.approx(wrist.mass, rel=0.01)
    _, wrench, deviation = moved(wrist, ToolCompensation(ARM, tool, inertia=True, wait=0.02), 3.0)
    left, off = wrench[100:], deviation[100:]
    assert np.sqrt(np.mean(left[:, :3] ** 2)) < 1.2 * wrist.noise[0]
    assert np.sqrt(np.mean((left / off) ** 2)) == pytest.approx(1.0, abs=0.3)  # as far off as it says


def test_without_inertia_the_tools_own_motion_is_in_the_deviation():
    wrist = SensedTool(2)
    tool, _ = wrist.weighed().weigh()
    _, wrench, deviation = moved(wrist, ToolCompensation(ARM, tool), 2.0)
    assert np.sqrt(np.mean(wrench[100:, :3] ** 2)) > 10.0 * wrist.noise[0]
    assert np.sqrt(np.mean((wrench / deviation)[100:, :3] ** 2)) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("axes", [np.eye(3), -np.eye(3), np.eye(3)[[1, 2, 0]]])
@pytest.mark.parametrize("frame", ["base_link", "tool0", "forearm_link"])
def test_a_push_is_told_in_any_frame_whatever_the_sensors_axes(frame, axes):
    wrist = SensedTool(4, noise=0.01, axes=axes)
    tool, _ = wrist.weighed().weigh()
    push = np.array([5.0, -3.0, 8.0, 0.2, 0.1, -0.3])  # in the sensor's frame, about its origin
    _, wrench, _ = moved(wrist, ToolCompensation(ARM, tool, frame=frame), 0.2, lambda t: push, at=POSE)
    here, there = (forward_kinematics(ARM, POSE, name) for name in (ARM.tip, frame))
    force = here.rotation @ push[:3]
    moment = here.rotation @ push[3:] + np.cross(here.position - there.position, force)
    expected = np.r_[there.rotation.T @ force, there.rotation.T @ moment]
    assert_allclose(wrench.mean(axis=0), expected, atol=0.03)


def test_a_zero_is_taken_at_rest_and_a_drift_followed_but_no_contact():
    wrist = SensedTool(6, noise=0.05, drift=0.02)
    tool, _ = wrist.weighed().weigh()
    wrist.bias[:3] += [0.0, 2.0, 0.0]
    compensation = ToolCompensation(ARM, tool, drift=0.05)
    compensation.begin_zero(0.0)
    touched = np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0])
    times, wrench, _ = moved(wrist, compensation, 20.0, lambda t: touched * (12.0 < t < 16.0), at=POSE)
    free = np.r_[300:5900, 8600:10000]  # 0.4 N of drift by the end
    assert np.abs(wrench[free].mean(axis=0)).max() < 0.05
    assert_allclose(wrench[(times > 14.0) & (times < 16.0)].mean(axis=0)[:3], touched[:3], atol=0.1)


def test_no_zero_is_taken_while_the_arm_moves():
    wrist = SensedTool(8)
    compensation = ToolCompensation(ARM, wrist.weighed().weigh()[0])
    compensation.begin_zero(0.0)
    moved(wrist, compensation, 5.2)
    assert not compensation.is_zeroing
    assert "the arm is moving" in compensation.complaint
    assert not compensation.zero.any()


def test_a_cable_that_drags_later_is_told_after_some_poses_at_rest(rng):
    wrist = SensedTool(10, noise=0.02)
    compensation = ToolCompensation(ARM, wrist.weighed().weigh()[0])
    for dragged in (False, True):
        begin = 1000.0 * dragged
        for k in range(8):
            q = POSE + rng.uniform(-1.0, 1.0, 6) * [0.5, 0.4, 0.4, 1.5, 1.5, 2.0]
            pose = forward_kinematics(ARM, q)
            cable = pose.rotation.T @ (2.0 * dragged * ([0.0, 0.0, 1.2] - pose.position))
            load = wrist.load(q, 0.0 * q, 0.0 * q) + np.r_[cable, np.zeros(3)]
            for i in range(90):
                t = begin + 2.0 * k + 0.01 * i
                compensation.motion.put(t, q, 0.0 * q)
                compensation.update(t, wrist.reads(load), LEVEL)
        assert ("a cable drags" in compensation.complaint) == dragged


def test_the_traced_load_is_pinocchios(rng):
    wrist = SensedTool(12, noise=0.0)
    tool, _ = wrist.weighed().weigh()
    q, qd, qdd = rng.normal(size=(3, 6))
    found = evaluate_line(tool_line(ARM, tool), q=q, qd=qd, qdd=qdd, gravity=LEVEL)
    assert_allclose(found, wrist.load(q, qd, qdd), atol=1e-9)


@pytest.mark.parametrize("measured", [True, False])
def test_a_parabola_about_a_time_gives_rates_there(measured):
    motion = JointMotion(1, 0.02)
    for t in np.arange(0.0, 1.0, 0.004):
        motion.put(t, [np.sin(3.0 * t)], [3.0 * np.cos(3.0 * t)] if measured else None)
    motion.put(0.5, [9.0])  # late ones do not count
    q, qd, qdd = motion.at(0.9)
    assert_allclose([*q, *qd, *qdd], [np.sin(2.7), 3.0 * np.cos(2.7), -9.0 * np.sin(2.7)], rtol=2e-3)
    alone = JointMotion(1)
    alone.put(0.0, [0.5])
    assert_allclose(alone.at(0.1), [[0.5], [0.0], [0.0]])


def test_impossible_options_are_refused():
    tool, _ = SensedTool(0).weighed().weigh()
    for wrong in ({"drift": -1.0}, {"wait": np.nan}, {"frame": "nowhere"}, {"gravity_deviation": -1.0}):
        with pytest.raises(InputError):
            ToolCompensation(ARM, tool, **wrong)
