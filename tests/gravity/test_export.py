import ctypes
import shutil
import subprocess
from dataclasses import replace
from functools import partial
from typing import get_args

import casadi
import jax
import numpy as np
import pytest
import sympy
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.dynamics.inverse_dynamics import (
    BaseMotion,
    coriolis_matrix,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    torque_derivatives,
)
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, MissingInertiaError, MissingPackageError, NotReadyError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.export import ExportedQuantity, export_function
from catenary.gravity.gravity_regressor import standard_gravity_regressor
from catenary.gravity.torque import gravity_torque
from catenary.kernels.c99 import c_name
from catenary.robots.actuation import Actuation, Friction, actuation_terms
from catenary.robots.catalog import load_robot
from oracles.every_load import every_load
from oracles.floating_base import Free, by_pinocchio
from oracles.random_trees import random_robot

ROBOT = random_robot(12)
TREE = ROBOT.model  # branching, three joints slide, four joints on three coordinates
CASES = [*((TREE, quantity) for quantity in get_args(ExportedQuantity)), (load_robot("raven2"), "gravity")]
MOVING = ("q", "qd", "qdd", "gravity")  # torques are drawn as qdd is
TURNING = (*MOVING, "omega", "alpha")
INPUTS = {
    "mass_matrix": ("q",), "forward_kinematics": ("q",),
    "inverse_dynamics_on_moving_base": TURNING, "holding": ("q", "gravity", "omega", "alpha"),
}  # fmt: skip
INPUTS |= dict.fromkeys(("inverse_dynamics", "feedforward", "forward_dynamics"), MOVING)
PACKAGES = ("jax", "casadi", "sympy")


@pytest.fixture(autouse=True)
def float64():
    jax.config.update("jax_enable_x64", True)


def arrays_of(model, quantity, seed=0):
    rng = np.random.default_rng(seed)
    sizes = {name: model.n if name.startswith("q") else 3 for name in TURNING}
    drawn = {name: rng.normal(size=size) for name, size in sizes.items()}
    return [drawn[name] for name in INPUTS.get(quantity, ("q", "gravity"))]


def by_recursion(model, quantity, arrays):
    if quantity == "forward_kinematics":
        pose = forward_kinematics(model, *arrays)
        return np.column_stack([pose.rotation, pose.position])
    if quantity in ("holding", "inverse_dynamics_on_moving_base"):
        q, *rates, gravity, omega, alpha = arrays
        floating = Free(np.eye(3), np.zeros(3), BaseMotion(omega, alpha, np.zeros(3)))
        return by_pinocchio(ROBOT, q, *(rates or 2 * [np.zeros(model.n)]), gravity, floating)
    return {
        "gravity": gravity_torque,
        "mass_matrix": mass_matrix,
        "inverse_dynamics": inverse_dynamics,
        "feedforward": inverse_dynamics,
        "forward_dynamics": forward_dynamics,
        "standard_gravity_regressor": standard_gravity_regressor,
        "compact_regressor": lambda model, *arrays: compact_regressor(model).Z(*arrays),
    }[quantity](model, *arrays)


def by_sympy(function, arrays):
    symbols = [symbol for array in function.inputs.values() for symbol in array]
    numbers = sympy.lambdify(symbols, list(function.result), "math", cse=True)(*np.concatenate(arrays))
    return np.array(numbers, dtype=float)


def by_c(text, name, arrays, size, folder):
    """Call the one function of a header, compiled with every warning an error."""
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    arguments = ", ".join(f"const double *a{k}" for k in range(len(arrays)))
    call = f"void call({arguments}, double *out) {{ {name}({', '.join(f'a{k}' for k in range(len(arrays)))}, out); }}"
    (folder / "f.c").write_text(
        f"{text}\n{text.partition('#endif')[0]}#endif\nvoid call({arguments}, double *out);\n{call}\n"
    )
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]
    subprocess.run(["gcc", *strict, folder / "f.c", "-o", folder / "f.so", "-lm"], check=True)
    out = (ctypes.c_double * size)()
    given = [(ctypes.c_double * len(array))(*array) for array in arrays]
    ctypes.CDLL(str(folder / "f.so")).call(*given, out)
    return np.array(out)


def assert_all_give(expected, model, quantity, arrays, folder, **given):
    """Compare what every target computes with what is expected."""
    text = export_function(model, quantity, "c99", **given)
    name = next(word for word in text.replace("(", " ").split() if word.endswith(f"_{quantity}"))
    found = {
        "jax": export_function(model, quantity, "jax", **given)(*arrays),
        "casadi": export_function(model, quantity, "casadi", **given)(*arrays),
        "sympy": by_sympy(export_function(model, quantity, "sympy", **given), arrays),
        "c99": by_c(text, name, arrays, expected.size, folder),
    }
    assert found["jax"].shape == expected.shape
    for target, result in found.items():
        result = np.array(result).reshape(expected.shape)
        assert_allclose(result, expected, rtol=1e-9, atol=1e-10, err_msg=target)


@pytest.mark.parametrize(("model", "quantity"), CASES, ids=lambda case: getattr(case, "name", case))
def test_every_target_computes_what_the_recursion_computes(model, quantity, tmp_path):
    arrays = arrays_of(model, quantity)
    assert_all_give(by_recursion(model, quantity, arrays), model, quantity, arrays, tmp_path)


@pytest.mark.parametrize("with_loads", [False, True])
@pytest.mark.parametrize("quantity", ["inverse_dynamics", "forward_dynamics"])
def test_a_name_means_in_every_target_what_it_means_in_python(quantity, with_loads, rng, tmp_path):
    arm = load_robot("raven2")
    loads = every_load(arm.n, rng)
    arm = replace(arm, actuation=replace(loads.actuation, values=loads.values))
    given = {"loads": known_loads(arm)} if with_loads else {}
    arrays = arrays_of(arm, quantity, seed=4)
    q, qd, third, gravity = arrays
    M, held = mass_matrix(arm, q), coriolis_matrix(arm, q, qd) @ qd + gravity_torque(arm, q, gravity)
    added = partial(loads.torque, q[None], qd[None])
    if quantity == "inverse_dynamics":
        links = M @ third + held
        expected = links + (added(third[None], links[None])[0] if with_loads else 0.0)
    elif with_loads:
        expected = np.linalg.solve(M + loads.rotors, third - held - added(0.0 * q[None])[0])
    else:
        expected = np.linalg.solve(M, third - held)
    python = {"inverse_dynamics": inverse_dynamics, "forward_dynamics": forward_dynamics}[quantity]
    assert_allclose(python(arm, *arrays, **given), expected, rtol=1e-9)
    assert_all_give(expected, arm, quantity, arrays, tmp_path, **given)


@pytest.mark.parametrize("quantity", ["feedforward", "forward_dynamics"])
@pytest.mark.parametrize("smooth", [0.05, 0.0])
def test_friction_and_drives_are_in_every_target(quantity, smooth, rng, tmp_path):
    arm = load_robot("raven2")
    loads = every_load(arm.n, rng, smooth=smooth)
    q, qd, third, _ = arrays = arrays_of(arm, quantity, seed=5)
    if quantity == "feedforward":
        links = inverse_dynamics(arm, *arrays)
        expected = links + loads.torque(q[None], qd[None], third[None], links[None])[0]
    else:
        expected = forward_dynamics(arm, *arrays, loads=loads)
    assert_all_give(expected, arm, quantity, arrays, tmp_path, loads=loads)
    if quantity == "feedforward":  # friction that a brake lets grow with the load
        brake = Actuation(friction=(Friction("brake", np.eye(3)[1], coulomb=False, viscous=False, load=True),))
        rubbing = ActuationLoads(3, brake, actuation_terms(brake), np.array([0.1, 0.2]))
        asked = links + rubbing.torque(q[None], qd[None], third[None], links[None])[0]
        assert_allclose(np.array(export_function(arm, quantity, "casadi", loads=rubbing)(*arrays)).ravel(), asked)
        with pytest.raises(InputError, match="its friction depends on the load, and so on the accelerations"):
            export_function(arm, "forward_dynamics", "casadi", loads=rubbing)


def test_a_robot_that_brings_friction_says_which_function_has_it(rng, caplog):
    arm = load_robot("raven2")
    loads = every_load(arm.n, rng)
    arm = replace(arm, actuation=replace(loads.actuation, values=loads.values))
    arrays = arrays_of(arm, "feedforward")
    whole = np.array(export_function(arm, "feedforward", "casadi")(*arrays)).ravel()
    given = np.array(export_function(load_robot("raven2"), "feedforward", "casadi", loads=loads)(*arrays)).ravel()
    assert_allclose(whole, given)
    assert not caplog.records
    for quantity in ("inverse_dynamics", "inverse_dynamics_on_moving_base", "forward_dynamics"):
        caplog.clear()
        export_function(arm, quantity, "casadi")
        assert f"{quantity} is of its links alone; loads= adds friction and rotors" in caplog.text
    with pytest.raises(InputError, match=r"only inverse_dynamics, .*, feedforward have them, not gravity"):
        export_function(arm, "gravity", "casadi", loads=loads)


@pytest.mark.parametrize("name", ["two_link", "raven2"])
def test_gradients_of_gravity_are_its_stiffness(name):
    model = load_robot(name)
    q, gravity = arrays_of(model, "gravity", seed=1)
    expected = torque_derivatives(model, q, 0 * q, 0 * q, gravity)[0]
    function = export_function(model, "gravity", "jax")
    assert_allclose(jax.jacfwd(function)(q, gravity), expected, atol=1e-10)
    assert_allclose(jax.jacrev(function)(q, gravity), expected, atol=1e-10)
    slope = export_function(model, "gravity", "casadi").jacobian()
    assert slope.name_in(0) == "q"
    assert_allclose(np.array(slope(q, gravity, 0)[0]), expected, atol=1e-10)
    symbolic = export_function(model, "gravity", "sympy")
    derived = replace(symbolic, result=symbolic.result.jacobian(symbolic.inputs["q"]))
    assert_allclose(by_sympy(derived, [q, gravity]), expected.ravel(), atol=1e-10)


def test_jax_takes_batches_and_names(rng):
    q, gravity = rng.normal(size=(5, 3)), np.array([0.0, 0.0, -9.81])
    model = load_robot("raven2")
    function = export_function(model, "gravity", "jax")
    batch = jax.vmap(function, in_axes=(0, None))(q, gravity)
    assert_allclose(batch, gravity_torque(model, q, gravity), atol=1e-12)
    assert function(gravity=gravity, q=q[0].astype(np.float32)).dtype == np.float64


def test_jax_demands_float64_and_tells_how():
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(NotReadyError, match=r'jax\.config\.update\("jax_enable_x64", True\)'):
        export_function(load_robot("two_link"), "gravity", "jax")


def test_jax_names_the_array_of_another_shape():
    function = export_function(load_robot("two_link"), "gravity", "jax")
    with pytest.raises(InputError, match=r"q: expected shape \(2,\), got \(3,\); jax.vmap takes batches"):
        function(np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="expected q, gravity, got 1 arrays and q"):
        function(np.zeros(2))


def test_casadi_functions_have_named_arrays():
    function = export_function(load_robot("raven2"), "inverse_dynamics", "casadi")
    assert (function.name_in(), function.name_out()) == (["q", "qd", "qdd", "gravity"], ["tau"])
    found = function(q=[0.1, 0.2, 0.3], gravity=[0.0, 0.0, -9.81])["tau"]  # what is not given is zero
    held = gravity_torque(load_robot("raven2"), [0.1, 0.2, 0.3], [0.0, 0.0, -9.81])
    assert_allclose(np.array(found).ravel(), held, atol=1e-12)
    M = export_function(load_robot("raven2"), "mass_matrix", "casadi")
    assert isinstance(M(casadi.SX.sym("q", 3)), casadi.SX)


def test_sympy_prints_a_two_link_arm_as_one_writes_it():
    gravity = export_function(load_robot("two_link"), "gravity", "sympy")
    first, second = str(gravity).split("\n")
    assert second == "0.25*gravity_x*sin(q1 + q2) - 0.25*gravity_z*cos(q1 + q2)"
    assert first == f"1.5*gravity_x*sin(q1) + {second.replace(' -', ' - 1.5*gravity_z*cos(q1) -')}"
    M = export_function(load_robot("two_link"), "mass_matrix", "sympy")
    assert str(M).split("\n")[0] == "[0.5*cos(q2) + 1.41667, 0.25*cos(q2) + 0.0833333]"


@pytest.mark.parametrize("target", PACKAGES)
def test_a_package_that_is_missing_is_named(target, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, target, None)
    with pytest.raises(MissingPackageError, match=f"pip install .*{target}"):
        export_function(load_robot("two_link"), "gravity", target)


def test_what_cannot_be_exported_is_refused():
    arm = load_robot("two_link")
    with pytest.raises(InputError, match='quantity "weight": expected one of gravity, holding'):
        export_function(arm, "weight", "jax")
    with pytest.raises(InputError, match='to "fortran": expected one of jax, casadi, sympy, c99'):
        export_function(arm, "gravity", "fortran")
    with pytest.raises(InputError, match="only forward_kinematics has one"):
        export_function(arm, "gravity", "jax", frame="link1")
    with pytest.raises(InputError, match="no frame"):
        export_function(arm, "forward_kinematics", "jax", frame="nose")
    with pytest.raises(MissingInertiaError):
        export_function(load_robot("tiago"), "gravity", "c99")


@pytest.mark.parametrize(
    ("text", "name"), [("raven2", "raven2"), ("Panda (left)", "panda_left"), ("2 link", "robot_2_link"), ("", "robot")]
)
def test_names_become_names_of_c(text, name):
    assert c_name(text) == name
