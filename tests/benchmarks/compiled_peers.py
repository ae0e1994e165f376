"""Compiled peers: a loop in C++ over Pinocchio, and CasADi's generated C, where compilers and headers are.

Pinocchio's wheel brings its own headers and Boost's; Eigen's come with casadi's wheel or the system.
"""

import ctypes
import importlib.util
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio

from catenary import RobotModel
from catenary.arrays import Floats
from catenary.dynamics.recursion import gravity_recursion, place_joints
from catenary.dynamics.symbolic import new_terms

SOURCE = """\
#include <pinocchio/fwd.hpp>
#if __has_include(<pinocchio/multibody.hpp>)
#include <pinocchio/multibody.hpp>
#else
#include <pinocchio/multibody/model.hpp>
#include <pinocchio/multibody/data.hpp>
#endif
#include <pinocchio/algorithm/rnea.hpp>
using namespace pinocchio;
typedef Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> Matrix;
typedef Eigen::Map<const Eigen::Vector3d> Vector;

typedef Eigen::Map<Eigen::VectorXd> Out;
typedef Eigen::Map<const Eigen::VectorXd> In;

static Model built(long joints, const long *parents, const double *numbers) {
  Model model;
  for (long i = 0; i < joints; ++i, numbers += 26) {
    const SE3 place(Matrix(numbers), Vector(numbers + 9));
    const std::string name = "j" + std::to_string(i);
    const JointIndex joint = numbers[25] != 0.0 ? model.addJoint(parents[i], JointModelPZ(), place, name)
                                                : model.addJoint(parents[i], JointModelRZ(), place, name);
    const Inertia body(numbers[12], Vector(numbers + 13), Matrix(numbers + 16));
    model.appendBodyToJoint(joint, body, SE3::Identity());
  }
  return model;
}

extern "C" void gravity_rows(long joints, const long *parents, const double *numbers, long count,
                             const double *q, double *out) {
  const Model model = built(joints, parents, numbers);
  Data data(model);
  for (long k = 0; k < count; ++k)
    Out(out + k * joints, joints) = computeGeneralizedGravity(model, data, In(q + k * joints, joints));
}

/* rows of q, qd, qdd */
extern "C" void motion_rows(long joints, const long *parents, const double *numbers, long count,
                            const double *rows, double *out) {
  const Model model = built(joints, parents, numbers);
  Data data(model);
  for (long k = 0; k < count; ++k, rows += 3 * joints)
    Out(out + k * joints, joints) =
        rnea(model, data, In(rows, joints), In(rows + joints, joints), In(rows + 2 * joints, joints));
}
"""


@cache
def _library(folder: Path) -> ctypes.CDLL | None:
    root = Path(str(pinocchio.__file__)).parents[4]
    eigen = _eigen()
    if eigen is None or shutil.which("g++") is None or not (root / "include" / "pinocchio").is_dir():
        return None
    source, library = folder / "loop.cpp", folder / "loop.so"
    source.write_text(SOURCE, encoding="utf-8")
    command = ["g++", "-O2", "-std=c++17", "-w", "-fPIC", "-shared", "-DNDEBUG"]
    # as Pinocchio itself is compiled
    command += ["-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30"]
    command += ["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION"]
    command += [f"-I{root / 'include'}", f"-I{eigen}", str(source), "-o", str(library)]
    command += [f"-L{root / 'lib'}", f"-Wl,-rpath,{root / 'lib'}", "-lpinocchio_default"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library))


def cpp_loop(
    model: RobotModel, q: Floats, out: Floats, folder: Path, *, motion: bool = False
) -> Callable[[], None] | None:
    """Return a call that writes gravity torques (N, n) at q (N, n), or None without compiler or headers.

    With `motion` they are torques of motions, by `rnea`, at rows (q, qd, qdd) (N, 3 n).

    The model is as `robots.pinocchio_robot` takes it, with joints along z only; it is built anew at every call.
    """
    library, tree = _library(folder), model.tree
    if library is None:
        return None
    assert (tree.axis == [0.0, 0.0, 1.0]).all()
    parents = np.ascontiguousarray(tree.parent + 1, dtype=np.int64)
    rows = (tree.rotation, tree.origin, tree.mass, tree.com, tree.inertia, tree.prismatic)
    numbers = np.hstack([np.asarray(each, dtype=float).reshape(model.n, -1) for each in rows])
    run = library.motion_rows if motion else library.gravity_rows
    number, array = ctypes.c_long, ctypes.c_void_p
    run.argtypes = [number, array, array, number, array, array]
    run.restype = None
    numbers = np.ascontiguousarray(numbers)  # alive as long as the call, as are the other arrays
    data = [each.ctypes for each in (parents, numbers, q, out)]
    return lambda: run(model.n, data[0].data, data[1].data, len(q), data[2].data, data[3].data)


def _eigen() -> Path | None:
    places = [Path("/usr/include/eigen3"), Path("/usr/local/include/eigen3")]
    found = importlib.util.find_spec("casadi")
    if found is not None and found.origin is not None:
        places.append(Path(found.origin).parent / "include" / "eigen3")
    return next((place for place in places if (place / "Eigen").is_dir()), None)


def casadi_gravity(
    model: RobotModel, q: Floats, gravity: Floats, out: Floats, folder: Path
) -> Callable[[], None] | None:
    """Return a call of the generated C by CasADi's buffer interface, on these arrays; None without casadi or a compiler."""
    if importlib.util.find_spec("casadi") is None or shutil.which("gcc") is None:
        return None
    import casadi

    n = model.n
    x, g = casadi.SX.sym("q", n), casadi.SX.sym("g", 3)
    values = [x[i] for i in range(n)]
    functions = (lambda v: v, casadi.sin, casadi.cos)
    columns = [np.array([f(v) for v in values] + [None], dtype=object)[:n] for f in functions]
    rotation, position, torque = new_terms(n, 3, 3), new_terms(n, 3), new_terms(n)
    place_joints(model.tree, *columns, rotation, position)
    work = new_terms(n + 1), new_terms(n + 1, 3), new_terms(n + 1, 3)
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
