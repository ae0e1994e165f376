"""Compact gravity regressor beside Pinocchio's joint torque regressor: one Python call each, and the estimators' tick."""

from functools import partial

import numpy as np
import pinocchio

from catenary import GravityEstimator, RobotModel, compact_regressor
from catenary.gravity.estimator import RecursiveGravityEstimator
from tests.benchmarks.measure import Call, Tables, report, side_by_side
from tests.benchmarks.robots import pinocchio_robot, robots

GRAVITY = np.array([0.0, 0.0, -9.81])


def contenders(model: RobotModel) -> dict[str, Call]:
    """Return the calls of one robot."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=model.n)
    pin = pinocchio_robot(model)
    data, zero = pin.createData(), np.zeros(pin.nv)
    regressor = compact_regressor(model)
    out = np.empty((model.n, len(regressor.labels)))
    torque = pinocchio.computeGeneralizedGravity(pin, data, q)
    assert np.abs(regressor.Z(q, GRAVITY) @ regressor.parameters() - torque).max() < 1e-9
    kernel = regressor.kernel()
    law = GravityEstimator(model, np.ones(model.n), np.ones(model.n))
    recursive = RecursiveGravityEstimator(model, noise=1.0, settle=0.0, interval=0.0, novelty=0.0)
    ticks = iter(range(10**12))
    return {
        "Pinocchio computeJointTorqueRegressor": partial(
            pinocchio.computeJointTorqueRegressor, pin, data, q, zero, zero
        ),
        "kernel, bound": kernel.bind(q, GRAVITY, out),
        "kernel, new array": partial(kernel, q, GRAVITY),
        "the paper's estimator, a tick": partial(law.update, q, zero, q, GRAVITY, 0.001),
        "least squares, a torque taken": lambda: recursive.update(q, zero, zero, GRAVITY, 0.01 * next(ticks)),
    }


def tables() -> Tables:
    """Compare for three, seven and nineteen joints; `times` is how much faster than Pinocchio."""
    found = {}
    for name, robot in robots().items():
        rows = side_by_side(contenders(robot.model))
        for row in rows.values():
            row["times"] = 1.0 / row.pop("ratio")
        found[f"{name}, us"] = rows
    return found


if __name__ == "__main__":
    report(tables, __doc__)
