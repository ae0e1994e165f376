"""Compact gravity regressor beside Pinocchio's joint torque regressor: one Python call each, and the estimators' tick."""

import numpy as np
import pinocchio
from tests.benchmarks.measure import Call, side_by_side, tell
from tests.oracles.pinocchio_trees import pinocchio_model, pinocchio_vector
from tests.oracles.random_trees import RandomRobot, random_bodies_on, random_inertia, random_pose

from catenary.gravity.compact import compact_regressor
from catenary.gravity.estimator import GravityEstimator
from catenary.gravity.recursive_estimator import RecursiveGravityEstimator
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot

GRAVITY = np.array([0.0, 0.0, -9.81])


def revolute_robot(name: str, parents: list[int]) -> RandomRobot:
    """Revolute joints about z of their frames, as DH tables have them, in no special arrangement."""
    rng = np.random.default_rng(0)
    links = [
        Link(
            f"link{i}",
            "base" if parent < 0 else f"link{parent}",
            "revolute",
            random_pose(rng),
            variable={f"q{i}": 1.0},
            inertia=random_inertia(rng),
        )
        for i, parent in enumerate(parents)
    ]
    return RandomRobot(assemble(name, links, [Coordinate(f"q{i}", "rad") for i in range(len(links))]), links)


def contenders(robot: RandomRobot) -> dict[str, Call]:
    """Calls of one robot, each at another configuration than the last."""
    model = robot.model
    rng = np.random.default_rng(1)
    configurations = rng.normal(size=(64, model.n))
    pin = pinocchio_model(robot)
    pin.gravity.linear = GRAVITY
    data, zero = pin.createData(), np.zeros(pin.nv)
    theirs = [pinocchio_vector(robot, pin, q) for q in configurations]
    ours = [np.array(q) for q in configurations]
    regressor = compact_regressor(model)
    kernel, out = regressor.kernel(), np.empty((model.n, len(regressor.labels)))
    law = GravityEstimator(model, np.ones(model.n), np.ones(model.n))
    recursive = RecursiveGravityEstimator(model, noise=1.0, settle=0.0, interval=0.0, novelty=0.0)
    turn = iter(range(10**12))
    return {
        "pinocchio computeJointTorqueRegressor": lambda: pinocchio.computeJointTorqueRegressor(
            pin, data, theirs[next(turn) % 64], zero, zero
        ),
        "compact regressor, kernel": lambda: kernel(ours[next(turn) % 64], GRAVITY, out),
        "the paper's estimator, a tick": lambda: law.update(
            ours[next(turn) % 64], zero, ours[0], GRAVITY, 0.001
        ),
        "least squares, a torque taken": lambda: recursive.update(
            ours[next(turn) % 64], zero, zero, GRAVITY, 0.01 * next(turn)
        ),
    }


def main() -> None:
    """Three joints as the RAVEN's, seven in a row, nineteen in a trunk and two arms."""
    trunk, arm = [-1, 0, 1], 8
    left = [2, *range(3, 3 + arm - 1)]
    right = [2, *range(3 + arm, 3 + 2 * arm - 1)]
    robots = {
        "RAVEN-II, 3 joints": random_bodies_on(load_robot("raven2"), np.random.default_rng(2)),
        "7 joints": revolute_robot("arm", list(range(-1, 6))),
        "19 joints, trunk and two arms": revolute_robot("upper body", trunk + left + right),
    }
    tell({f"{name}, us": side_by_side(contenders(robot)) for name, robot in robots.items()})


if __name__ == "__main__":
    main()
