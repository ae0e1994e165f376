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
from catenary.dynamics.kernels import forward_kinematics_kernel, inverse_dynamics_kernel, mass_matrix_kernel
from catenary.kernels.kernel import Kernel
from tests.benchmarks.casadi_gravity import casadi_gravity
from tests.benchmarks.measure import Call, side_by_side, tell
from tests.benchmarks.pinocchio_loop import cpp_loop
from tests.benchmarks.robots import pinocchio_robot, robots
from tests.oracles.mujoco_trees import mujoco_model
from tests.oracles.random_trees import RandomRobot

MANY = 100_000
ROUNDS = 5
Table = dict[str, dict[str, float]]


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

    def set_and_compute() -> None:
        pin.gravity.linear = gravity
        pinocchio.computeGeneralizedGravity(pin, data, q)

    expected = pinocchio.computeGeneralizedGravity(pin, data, q).copy()
    kernel = gravity_kernel(model)
    contenders: dict[str, Call] = {
        "Pinocchio": partial(pinocchio.computeGeneralizedGravity, pin, data, q),
        "Pinocchio, gravity set each call": set_and_compute,
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
    tables = {"gravity torque": beside("Pinocchio", contenders)}
    moving = inverse_dynamics_kernel(model).bind(q, qd, qdd, gravity, still, still.copy(), motion)
    for title, bound, checked, peer in (
        (
            "mass matrix (crba)",
            mass_matrix_kernel(model).bind(q, M),
            partial(mass_matrix, model, q),
            partial(pinocchio.crba, pin, data, q),
        ),
        (
            "inverse dynamics (rnea), on a base that may move",
            moving,
            partial(inverse_dynamics, model, q, qd, qdd, gravity),
            partial(pinocchio.rnea, pin, data, q, qd, qdd),
        ),
        (
            "forward kinematics",
            forward_kinematics_kernel(model).bind(q, pose),
            partial(forward_kinematics_kernel(model), q),
            partial(pinocchio.forwardKinematics, pin, data, q),
        ),
    ):
        tables[title] = beside("Pinocchio", {"Pinocchio": peer, "bound kernel": bound, "new array": checked})
    return tables


def many(model: RobotModel, rng: np.random.Generator, folder: Path) -> Table:
    """Time a hundred thousand configurations, one core [ns a configuration]."""
    pin = pinocchio_robot(model)
    data, n = pin.createData(), pin.nv
    q, gravity = rng.normal(size=(MANY, n)), np.array([[0.0, 0.0, -9.81]])
    torque, matrix = gravity_kernel(model), mass_matrix_kernel(model)
    tau, M = np.empty((MANY, n)), np.empty((MANY, n, n))

    def loop(compute: object) -> None:
        for row in q:
            compute(pin, data, row)  # type: ignore[operator]

    calls: dict[str, Call] = {
        "gravity, kernel": lambda: torque.rows(q, gravity, out=tau),
        "gravity, Python loop over Pinocchio": lambda: loop(pinocchio.computeGeneralizedGravity),
        "mass matrix, kernel": lambda: matrix.rows(q, out=M),
        "mass matrix, Python loop over Pinocchio": lambda: loop(pinocchio.crba),
    }
    in_cpp = cpp_loop(model, q, tau, folder)
    if in_cpp is not None:
        calls["gravity, C++ loop over Pinocchio"] = in_cpp
    times: dict[str, list[float]] = {name: [] for name in calls}
    for call in calls.values():
        call()
    if in_cpp is not None:
        in_cpp()
        assert np.abs(torque.rows(q, gravity) - tau).max() < 1e-10
    for _ in range(ROUNDS):
        for name, call in calls.items():
            begin = time.thread_time_ns()
            call()
            times[name].append((time.thread_time_ns() - begin) / MANY)
    table: Table = {name: {"cpu_ns": float(np.median(each))} for name, each in times.items()}
    for name, row in table.items():
        peer = f"{name.partition(',')[0]}, Python loop over Pinocchio"
        row["times"] = table[peer]["cpu_ns"] / row["cpu_ns"]
    return table


def start_up() -> Table:
    """Time new processes [s], with an empty cache and with a filled one; CPU time, as others may be busy."""
    use = "import numpy as np, catenary; from catenary.gravity.torque import gravity_kernel; "
    use += "k = gravity_kernel(catenary.load_robot('raven2')); k(np.zeros(3), np.zeros(3))"
    matrix = (
        "; from catenary.dynamics.kernels import mass_matrix_kernel as m; m(catenary.load_robot('raven2'))"
    )
    table: Table = {}
    many = "import catenary; catenary.gravity_torque(catenary.load_robot('raven2'), [0.0] * 3, [0.0] * 3)"
    with tempfile.TemporaryDirectory() as empty:
        # byte code as an installed package has it, from the second process on
        own = {
            "XDG_CACHE_HOME": empty,
            "NUMBA_CACHE_DIR": f"{empty}/numba",
            "PYTHONPYCACHEPREFIX": f"{empty}/bytes",
        }
        environment = {**os.environ, **own}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        for name, code in (
            ("python alone", ""),
            ("import numpy", "import numpy"),
            ("import catenary", "import catenary"),
            ("load_robot('raven2')", "import catenary; catenary.load_robot('raven2')"),
            ("import numba", "import numba"),
            ("raven2's kernels, cold", use + matrix),
            ("raven2's kernels, cached", use + matrix),
            ("a numba function of raven2, cold", many),
            ("a numba function of raven2, cached", many),
        ):
            wall, cpu = [], []
            for k in range(1 if "cold" in name else ROUNDS + 1):
                begin, before = time.perf_counter(), os.times()
                subprocess.run([sys.executable, "-c", code], check=True, env=environment)
                after = os.times()
                if k > 0 or "cold" in name:  # the first has no byte code
                    wall.append(time.perf_counter() - begin)
                    cpu.append(after[2] + after[3] - before[2] - before[3])  # of children
            table[name] = {"cpu_s": float(np.median(cpu)), "wall_s": float(np.median(wall))}
    return table


def compile_times(robot: RandomRobot) -> dict[str, float]:
    """Time tracing and compiling with an empty cache, in this process [s]."""
    makers: dict[str, Callable[[RobotModel], Kernel]] = {
        "gravity": gravity_kernel,
        "inverse dynamics": inverse_dynamics_kernel,
        "mass matrix": mass_matrix_kernel,
    }
    table = {}
    for name, make in makers.items():
        begin = time.process_time()
        kernel = make(robot.model)
        table[name] = time.process_time() - begin
        arrays = [np.zeros(width) for width in kernel.inputs.values()]
        begin = time.process_time()
        kernel.bind(*arrays, np.empty(kernel.shape))
        table[f"{name}, bound"] = time.process_time() - begin
    return table


def main() -> None:
    """Compare, and tell."""
    tables: dict[str, Table] = {}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        arms: dict[str, RandomRobot] = robots()
        tables["tracing and compiling, empty cache, s"] = {
            name: compile_times(arm) for name, arm in arms.items()
        }
        for name, arm in arms.items():
            for title, table in single_calls(arm, Path(folder)).items():
                tables[f"{name}: {title}"] = table
            tables[f"{name}: {MANY} configurations"] = many(arm.model, np.random.default_rng(1), Path(folder))
        tables["start-up"] = start_up()
    tell(tables)


if __name__ == "__main__":
    main()
