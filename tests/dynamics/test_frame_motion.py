import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.frame_motion import frame_motion
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.kinematics import forward_kinematics
from catenary.robots.catalog import load_robot
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order
from oracles.random_trees import random_rotation


@pytest.mark.parametrize("floats", [False, True])
def test_frames_move_as_in_pinocchio_on_a_base_that_stands_or_floats(floats, random_robots, rng) -> None:
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = rng.normal(size=(3, m.n))
        omega, alpha, acceleration, velocity = rng.normal(size=(4, 3)) if floats else np.zeros((4, 3))
        R_world_base = random_rotation(rng)
        pin = pinocchio_model(robot, base="free")
        data, order = pin.createData(), pinocchio_order(robot, pin)
        x, xd, xdd = np.zeros(pin.nq), np.zeros(pin.nv), np.zeros(pin.nv)
        x[3:7] = pinocchio.Quaternion(R_world_base).coeffs()
        x[order + 1] = m.coupling @ q + m.offset
        xd[:3], xd[3:6], xd[order] = velocity, omega, m.coupling @ qd
        # Pinocchio's base has the spatial acceleration, that of the point less omega x velocity
        xdd[:3], xdd[3:6], xdd[order] = acceleration - np.cross(omega, velocity), alpha, m.coupling @ qdd
        pinocchio.forwardKinematics(pin, data, x, xd, xdd)
        for link in robot.links:
            frame = pin.getFrameId(f"{link.name}_frame")
            axes = pinocchio.LOCAL_WORLD_ALIGNED
            twist = pinocchio.getFrameVelocity(pin, data, frame, axes)
            change = pinocchio.getFrameClassicalAcceleration(pin, data, frame, axes)
            base = BaseMotion(omega, alpha, acceleration, velocity) if floats else None
            found = frame_motion(m, q, qd, qdd, link.name, base=base)
            for ours, theirs in zip(found, (twist.linear, twist.angular, change.linear, change.angular), strict=True):
                assert_allclose(R_world_base @ ours, theirs, atol=1e-9, err_msg=f"{m.name} {link.name}")


def test_a_frame_of_the_base_moves_with_it() -> None:
    model = load_robot("raven2")
    base = BaseMotion([0.0, 0.0, 2.0], linear_velocity=[1.0, 0.0, 0.0])
    at = forward_kinematics(model, np.zeros(3), "frame0").position
    moved = frame_motion(model, np.zeros(3), np.ones(3), frame="frame0", base=base)
    assert_allclose(moved.angular_velocity, [0.0, 0.0, 2.0])
    assert_allclose(moved.velocity, [1.0 - 2.0 * at[1], 2.0 * at[0], 0.0], atol=1e-12)
