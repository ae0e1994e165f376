"""The exported C law beside Pinocchio's RNEA, each in a compiled loop over many motions."""

import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from catenary import RobotModel, inverse_dynamics
from catenary.arrays import Floats
from catenary.spatial import LEVEL
from catenary.workflows.c_header import c_header
from tests.benchmarks.compiled_peers import cpp_loop
from tests.benchmarks.measure import Call, Table, Tables, report, side_by_side
from tests.benchmarks.robots import robots

ROWS = 20_000
ROUNDS = 7
LOOP = """\
#include "robot.h"

void rows(long count, const double *rows, const double *gravity, double *out) {
  const double still[3] = {0.0, 0.0, 0.0};
  long k;
  (void)still;
  for (k = 0; k < count; ++k, rows += 3 * N, out += WIDTH) CALL;
}
"""
CALLS = {
    "feedforward": "feedforward(rows, rows + N, rows + 2 * N, gravity, NULL, NULL, out)",
    "holding on a moving base": "holding(rows, gravity, still, still, out)",
    "mass matrix": "mass_matrix(rows, out)",
    "gravity": "gravity(rows, gravity, out)",
}


def c_loop(model: RobotModel, what: str, rows: Floats, out: Floats, folder: Path) -> Callable[[], None]:
    """Return a call that runs one function of the exported header over rows (q, qd, qdd), built with -O2."""
    header = c_header(model)
    name = header.functions[0].removesuffix("_gravity")
    (folder / "robot.h").write_text(header.text)
    source = folder / f"{name}_{what.replace(' ', '_')}.c"
    source.write_text(LOOP)
    library = source.with_suffix(".so")
    numbers = [f"-DN={model.n}", f"-DWIDTH={out.size // len(rows)}", f"-DCALL={name}_{CALLS[what]}"]
    command = ["gcc", "-O2", "-fPIC", "-shared", *numbers, str(source), "-o", str(library), "-lm"]
    subprocess.run(command, check=True)
    function = ctypes.CDLL(str(library)).rows
    function.argtypes, function.restype = [ctypes.c_long, *[ctypes.c_void_p] * 3], None
    arrays = [array.ctypes for array in (rows, LEVEL.copy(), out)]  # alive as long as the call
    return lambda: function(len(rows), arrays[0].data, arrays[1].data, arrays[2].data)


def law(model: RobotModel, folder: Path) -> Table:
    """Time a motion [ns]; `times` is how much faster than Pinocchio's RNEA, which is the feedforward on a base at rest."""
    n = model.n
    rows = np.random.default_rng(0).normal(size=(ROWS, 3 * n))
    expected = inverse_dynamics(model, *np.split(rows, 3, axis=1), LEVEL)
    calls: dict[str, Call] = {}
    for what in CALLS:
        out = np.empty((ROWS, n * n if what == "mass matrix" else n))
        calls[what] = c_loop(model, what, rows, out, folder)
        calls[what]()
        assert what != "feedforward" or np.abs(out - expected).max() < 1e-9 * np.abs(expected).max()
    theirs = np.empty((ROWS, n))
    peer = cpp_loop(model, rows, theirs, folder, motion=True)
    if peer is not None:
        peer()
        assert np.abs(theirs - expected).max() < 1e-9 * np.abs(expected).max()
        calls = {"Pinocchio's rnea, C++": peer} | calls
    measured = side_by_side(calls, calls=1, rounds=ROUNDS)
    table: Table = {name: {"cpu_ns": 1e3 * row["cpu_us"] / ROWS} for name, row in measured.items()}
    if peer is not None:
        table["feedforward"]["times"] = next(iter(table.values()))["cpu_ns"] / table["feedforward"]["cpu_ns"]
    return table


def tables() -> Tables:
    """Compare on every robot."""
    with tempfile.TemporaryDirectory() as folder:
        return {f"{name}: {ROWS} motions": law(arm.model, Path(folder)) for name, arm in robots().items()}


if __name__ == "__main__":
    report(tables, __doc__)
