"""Kernels beside Pinocchio, MuJoCo and CasADi, one configuration a call and many; start-up times."""

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

from catenary.dynamics.kernels import (
    forward_kinematics_kernel,
    gravity_kernel,
    inverse_dynamics_kernel,
    mass_matrix_kernel,
    write_gravity_torques,
    write_mass_matrices,
)
from catenary.robots.model import RobotModel
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
    q, qd, qdd = rng.normal(size=(3, n))
    q, qd, qdd = q.copy(), qd.copy(), qdd.copy()
    gravity, tau, M, pose = np.array([0.0, 0.0, -9.81]), np.empty(n), np.empty((n, n)), np.empty((3, 4))

    def set_and_compute() -> None:
        pin.gravity.linear = gravity
        pinocchio.computeGeneralizedGravity(pin, data, q)

    expected = pinocchio.computeGeneralizedGravity(pin, data, q).copy()
    kernels = {backend: gravity_kernel(model, backend=backend) for backend in ("llvm", "c")}
    assert np.abs(kernels["llvm"](q, gravity) - expected).max() < 1e-10
    contenders: dict[str, Call] = {
        "Pinocchio": partial(pinocchio.computeGeneralizedGravity, pin, data, q),
        "Pinocchio, gravity set each call": set_and_compute,
        **{f"kernel.into, {k.backend}": partial(k.into, q, gravity, tau) for k in kernels.values()},
        "kernel, llvm": partial(kernels["llvm"], q, gravity, tau),
        "kernel, llvm, new array": partial(kernels["llvm"], q, gravity),
    }
    generated = casadi_gravity(model, q, gravity, tau, folder)
    if generated is not None:
        generated()
        assert np.abs(tau - expected).max() < 1e-10
        contenders["CasADi generated C, buffers"] = generated
    if robot.links:
        mj = mujoco_model(robot, gravity=gravity)
        contenders["MuJoCo mj_forward"] = partial(mujoco.mj_forward, mj, mujoco.MjData(mj))
    tables = {"gravity torque": beside("Pinocchio", contenders)}
    made = {
        "mass matrix (crba)": (mass_matrix_kernel, (q, M), partial(pinocchio.crba, pin, data, q)),
        "inverse dynamics (rnea)": (
            inverse_dynamics_kernel,
            (q, qd, qdd, gravity, tau),
            partial(pinocchio.rnea, pin, data, q, qd, qdd),
        ),
        "forward kinematics": (
            forward_kinematics_kernel,
            (q, pose),
            partial(pinocchio.forwardKinematics, pin, data, q),
        ),
    }
    for title, (make, arguments, peer) in made.items():
        ours = {k.backend: partial(k.into, *arguments) for k in (make(model), make(model, backend="c"))}  # type: ignore[operator]
        tables[title] = beside(
            "Pinocchio", {"Pinocchio": peer, **{f"kernel.into, {name}": call for name, call in ours.items()}}
        )
    return tables


def many(model: RobotModel, rng: np.random.Generator, folder: Path) -> Table:
    """Time a hundred thousand configurations, one core [ns a configuration]."""
    pin = pinocchio_robot(model)
    data, n = pin.createData(), pin.nv
    q, gravity = rng.normal(size=(MANY, n)), np.array([[0.0, 0.0, -9.81]])
    tau, M = np.empty((MANY, n)), np.empty((MANY, n, n))

    def loop(compute: object) -> None:
        for row in q:
            compute(pin, data, row)  # type: ignore[operator]

    calls: dict[str, Call] = {
        "gravity, kernel": lambda: write_gravity_torques(model, q, gravity, tau),
        "gravity, Python loop over Pinocchio": lambda: loop(pinocchio.computeGeneralizedGravity),
        "mass matrix, kernel": lambda: write_mass_matrices(model, q, M),
        "mass matrix, Python loop over Pinocchio": lambda: loop(pinocchio.crba),
    }
    in_cpp = cpp_loop(model, q, tau, folder)
    if in_cpp is not None:
        calls["gravity, C++ loop over Pinocchio"] = in_cpp
    times: dict[str, list[float]] = {name: [] for name in calls}
    expected = None
    for name, call in calls.items():
        call()
        if "gravity" in name and "Python" not in name:
            assert expected is None or np.abs(tau - expected).max() < 1e-10
            expected = tau.copy()
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
            ("raven2's kernels by C, cold", (use + matrix).replace("2')", "2'), backend='c'")),
            ("raven2's kernels by C, cached", (use + matrix).replace("2')", "2'), backend='c'")),
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
    table = {}
    for backend in ("llvm", "c"):
        for name, make in (("gravity", gravity_kernel), ("mass matrix", mass_matrix_kernel)):
            begin = time.perf_counter()
            make(robot.model, backend=backend)  # type: ignore[operator]
            table[f"{name}, {backend}"] = time.perf_counter() - begin
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
