"""CasADi's generated C for the same recursion, where casadi and a compiler are installed."""

import importlib.util
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from catenary import RobotModel
from catenary.arrays import Floats
from catenary.dynamics.lines import empty
from catenary.dynamics.recursion import gravity_recursion, place_joints


def casadi_gravity(
    model: RobotModel, q: Floats, gravity: Floats, out: Floats, folder: Path
) -> Callable[[], None] | None:
    """Return a call of the generated C by CasADi's buffer interface, on these arrays; None without casadi."""
    if importlib.util.find_spec("casadi") is None or shutil.which("gcc") is None:
        return None
    import casadi

    n = model.n
    x, g = casadi.SX.sym("q", n), casadi.SX.sym("g", 3)
    values = [x[i] for i in range(n)]
    functions = (lambda v: v, casadi.sin, casadi.cos)
    columns = [np.array([f(v) for v in values] + [None], dtype=object)[:n] for f in functions]
    rotation, position, torque = empty(n, 3, 3), empty(n, 3), empty(n)
    place_joints(model.tree, *columns, rotation, position)
    work = empty(n + 1), empty(n + 1, 3), empty(n + 1, 3)
    gravity_recursion(model.tree, rotation, position, (g[0], g[1], g[2]), *work, torque)
    function = casadi.Function("gravity", [x, g], [casadi.vertcat(*torque)])
    written = folder / f"{model.name}_casadi.c"
    function.generate(written.name)
    Path(written.name).replace(written)
    library = written.with_suffix(".so")
    command = ["gcc", "-O3", "-march=native", "-fPIC", "-shared", str(written), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    buffer, call = casadi.external("gravity", str(library)).buffer()
    buffer.set_arg(0, memoryview(q))
    buffer.set_arg(1, memoryview(gravity))
    buffer.set_res(0, memoryview(out))
    casadi_gravity.kept = [*getattr(casadi_gravity, "kept", []), buffer]  # type: ignore[attr-defined]
    return call
