"""Kernels beside Pinocchio, MuJoCo and CasADi, one configuration a call and many; start-up times."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

from catenary import RobotModel, gravity_kernel, gravity_torque, inverse_dynamics, mass_matrix
from catenary.dynamics.robot_kernels import forward_kinematics_kernel, inverse_dynamics_kernel, mass_matrix_kernel
from catenary.kernels.kernel import Kernel
from tests.benchmarks.compiled_peers import casadi_gravity, cpp_loop
from tests.benchmarks.measure import Call, Table, Tables, cpu_time, report, side_by_side
from tests.benchmarks.robots import pinocchio_robot, robots
from tests.oracles.mujoco_trees import mujoco_model
from tests.oracles.random_trees import RandomRobot

MANY = 100_000
ROUNDS = 5


def beside(peer: str, contenders: dict[str, Call]) -> Table:
    """Measure side by side; `times` is how much faster than the peer.

    Whole calls from Python are compared, what calling costs included: nothing is subtracted from either.
    """
    rows = side_by_side(contenders)
    for row in rows.values():
        row["times"] = rows[peer]["cpu_us"] / row["cpu_us"]
        del row["ratio"]
    return rows


def single_calls(robot: RandomRobot, folder: Path) -> dict[str, Table]:
    """Time one configuration a call."""
    model, rng = robot.model, np.random.default_rng(0)
    n = model.n
    pin = pinocchio_robot(model)
    data = pin.createData()
    q, qd, qdd = (row.copy() for row in rng.normal(size=(3, n)))
    gravity, still = np.array([0.0, 0.0, -9.81]), np.zeros(3)
    tau, motion, M, pose = np.empty(n), np.empty(n), np.empty((n, n)), np.empty((3, 4))

    expected = pinocchio.computeGeneralizedGravity(pin, data, q).copy()
    kernel = gravity_kernel(model)
    contenders: dict[str, Call] = {
        "Pinocchio": partial(pinocchio.computeGeneralizedGravity, pin, data, q),
        "bound kernel": kernel.bind(q, gravity, tau),
        "kernel, new array": partial(kernel, q, gravity),
        "gravity_torque, checked": partial(gravity_torque, model, q, gravity),
        "an empty builtin": [].__len__,
    }
    contenders["bound kernel"]()
    assert np.abs(tau - expected).max() < 1e-10
    generated = casadi_gravity(model, q, gravity, tau, folder)
    if generated is not None:
        generated()
        assert np.abs(tau - expected).max() < 1e-10
        contenders["CasADi generated C, buffers"] = generated
    if robot.links:
        mj = mujoco_model(robot, gravity=gravity)
        contenders["MuJoCo mj_forward"] = partial(mujoco.mj_forward, mj, mujoco.MjData(mj))
    found = {"gravity torque": beside("Pinocchio", contenders)}
    moving = inverse_dynamics_kernel(model).bind(q, qd, qdd, gravity, still, still.copy(), motion)
    placing = forward_kinematics_kernel(model)
    others = {
        "mass matrix (crba)": {
            "Pinocchio": partial(pinocchio.crba, pin, data, q),
            "bound kernel": mass_matrix_kernel(model).bind(q, M),
            "new array": partial(mass_matrix, model, q),
        },
        "inverse dynamics (rnea), on a base that may move": {
            "Pinocchio": partial(pinocchio.rnea, pin, data, q, qd, qdd),
            "bound kernel": moving,
            "new array": partial(inverse_dynamics, model, q, qd, qdd, gravity),
        },
        "forward kinematics": {
            "Pinocchio": partial(pinocchio.forwardKinematics, pin, data, q),
            "bound kernel": placing.bind(q, pose),
            "new array": partial(placing, q),
        },
    }
    return found | {title: beside("Pinocchio", contenders) for title, contenders in others.items()}


def many(model: RobotModel, rng: np.random.Generator, folder: Path) -> Table:
    """Time a hundred thousand gravity torques, one core [ns a configuration]."""
    q, gravity = rng.normal(size=(MANY, model.n)), np.array([[0.0, 0.0, -9.81]])
    torque, tau = gravity_kernel(model), np.empty((MANY, model.n))
    calls: dict[str, Call] = {"kernel": lambda: torque.rows(q, gravity, out=tau)}
    in_cpp = cpp_loop(model, q, tau, folder)
    if in_cpp is not None:
        calls = {"C++ loop over Pinocchio": in_cpp} | calls
        in_cpp()
        assert np.abs(torque.rows(q, gravity) - tau).max() < 1e-10
    rows = side_by_side(calls, calls=1, rounds=ROUNDS)
    return {name: {"cpu_ns": 1e3 * row["cpu_us"] / MANY, "times": 1.0 / row["ratio"]} for name, row in rows.items()}


STARTS = {
    "python alone": "",
    "import numpy": "import numpy",
    "import catenary": "import catenary",
    "load_robot('raven2')": "import catenary; catenary.load_robot('raven2')",
    "import numba": "import numba",
    "raven2's kernels": (
        "import numpy as np, catenary; r = catenary.load_robot('raven2'); k = catenary.gravity_kernel(r); "
        "k(np.zeros(3), np.zeros(3)); from catenary.dynamics.robot_kernels import mass_matrix_kernel; mass_matrix_kernel(r)"
    ),
    "a first torque": ("import catenary; catenary.gravity_torque(catenary.load_robot('raven2'), [0.0] * 3, [0.0] * 3)"),
}


def start_up() -> Table:
    """Time new processes [s], with an empty cache and with a filled one; CPU time, as others may be busy."""
    table: Table = {}
    with tempfile.TemporaryDirectory() as empty:
        # byte code as an installed package has it, from the second process on
        caches = {"NUMBA_CACHE_DIR": f"{empty}/numba", "PYTHONPYCACHEPREFIX": f"{empty}/bytes"}
        environment = {**os.environ, "XDG_CACHE_HOME": empty, **caches}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        for name, code in STARTS.items():
            spent = []
            for _ in range(ROUNDS + 1):
                begin, before = time.perf_counter(), _cpu_of_children()
                subprocess.run([sys.executable, "-c", code], check=True, env=environment)
                spent.append((_cpu_of_children() - before, time.perf_counter() - begin))
            # the first has neither byte code nor machine code
            cold, (cpu, wall) = spent[0], np.median(spent[1:], axis=0)
            warm = {"cpu_s": float(cpu), "wall_s": float(wall)}
            table[name] = {**warm, "cold_cpu_s": cold[0], "cold_wall_s": cold[1]}
    return table


def _cpu_of_children() -> float:
    times = os.times()
    return times.children_user + times.children_system


def compile_times(robot: RandomRobot) -> dict[str, float]:
    """Time tracing and compiling with an empty cache, in this process [s]."""
    makers: dict[str, Callable[[RobotModel], Kernel]] = {
        "gravity": gravity_kernel,
        "inverse dynamics": inverse_dynamics_kernel,
        "mass matrix": mass_matrix_kernel,
    }
    table = {}
    for name, make in makers.items():
        kernels: list[Kernel] = []
        table[name] = cpu_time(lambda make=make, kernels=kernels: kernels.append(make(robot.model)))
        kernel = kernels[0]
        arrays = [np.zeros(width) for width in kernel.inputs.values()]
        table[f"{name}, bound"] = cpu_time(partial(kernel.bind, *arrays, np.empty(kernel.shape)))
    return table


def tables() -> Tables:
    """Compare on every robot."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        arms = robots()
        compiling = {name: compile_times(arm) for name, arm in arms.items()}
        found = {"tracing and compiling, empty cache, s": compiling}
        for name, arm in arms.items():
            found |= {f"{name}: {title}": table for title, table in single_calls(arm, Path(folder)).items()}
            found[f"{name}: {MANY} gravity torques"] = many(arm.model, np.random.default_rng(1), Path(folder))
        found["start-up"] = start_up()
    return found


if __name__ == "__main__":
    report(tables, __doc__)
