from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics import kernels
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.kernels import (
    Backend,
    forward_kinematics_kernel,
    gravity_kernel,
    inverse_dynamics_kernel,
    mass_matrix_kernel,
    write_gravity_torques,
    write_mass_matrices,
)
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.mass_matrix import mass_matrix
from catenary.dynamics.traced import (
    forward_kinematics_line,
    gravity_line,
    inverse_dynamics_line,
    mass_matrix_line,
)
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.kernels.tracing import evaluate
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from oracles.catalogue import robots_with_inertia
from oracles.random_trees import RandomRobot, random_robot

NAMES = [*robots_with_inertia(), "random 8", "random 17", "random 26"]


def model_of(name: str) -> RobotModel:
    return random_robot(int(name.split()[1])).model if name.startswith("random ") else load_robot(name)


def states(model: RobotModel, count: int = 20):
    """Coordinates, velocities, accelerations, and gravity of a tilted base."""
    rng = np.random.default_rng(1)
    return *rng.normal(size=(3, count, model.n)), 5.0 * rng.normal(size=(count, 3))


def scale_of(values) -> float:
    return 1e-12 * max(1.0, float(np.abs(values).max()))  # of torques up to 1 kNm


@pytest.mark.parametrize("name", NAMES)
def test_kernels_give_what_the_recursions_give(name: str) -> None:
    m = model_of(name)
    torque, matrix, motion, pose = (
        gravity_kernel(m),
        mass_matrix_kernel(m),
        inverse_dynamics_kernel(m),
        forward_kinematics_kernel(m),
    )
    for q, qd, qdd, g in zip(*states(m), strict=True):
        for given, expected in (
            (torque(q, g), gravity_torque(m, q, g)),
            (matrix(q), mass_matrix(m, q)),
            (motion(q, qd, qdd, g), inverse_dynamics(m, q, qd, qdd, g)),
        ):
            assert_allclose(given, expected, rtol=0.0, atol=scale_of(expected))
        tip = forward_kinematics(m, q)
        assert_allclose(pose(q), np.column_stack([tip.rotation, tip.position]), rtol=0.0, atol=1e-12)


def test_traces_of_sixty_trees_give_what_the_recursions_give(random_robots: list[RandomRobot]) -> None:
    for robot in random_robots:
        m = robot.model
        (q,), (qd,), (qdd,), (g,) = states(m, 1)
        name = next(reversed(m.frames))
        tip = forward_kinematics(m, q, name)
        for line, expected in (
            (gravity_line(m), gravity_torque(m, q, g)),
            (mass_matrix_line(m), mass_matrix(m, q).ravel()),
            (inverse_dynamics_line(m), inverse_dynamics(m, q, qd, qdd, g)),
            (forward_kinematics_line(m, name), np.column_stack([tip.rotation, tip.position]).ravel()),
        ):
            given = evaluate(line, q=q, qd=qd, qdd=qdd, gravity=g)
            assert_allclose(given, expected, rtol=0.0, atol=scale_of(expected), err_msg=m.name)


@pytest.mark.parametrize("name", ["raven2", "random 8"])
@pytest.mark.parametrize("count", [0, 1, 2, 7, 64, 257])
def test_many_rows_are_single_ones_to_the_bit(name: str, count: int) -> None:
    m = model_of(name)
    q, _, _, g = states(m, count)
    torque, matrix = gravity_kernel(m), mass_matrix_kernel(m)
    for gravity in (g, g[:1]) if count > 0 else (np.zeros((1, 3)),):
        out = np.empty((count, m.n))
        write_gravity_torques(m, q, gravity, out)
        for k in range(count):
            assert (out[k] == torque(q[k], gravity[k if len(gravity) > 1 else 0])).all()
    matrices = np.empty((count, m.n, m.n))
    write_mass_matrices(m, q, matrices)
    for k in range(count):
        assert (matrices[k] == matrix(q[k])).all()


def test_rows_with_angles_beyond_the_quick_sines_are_right_too() -> None:
    m = model_of("random 8")
    q, _, _, g = states(m, 200)
    q[[3, 150]] *= 1e6
    out = np.empty((200, m.n))
    write_gravity_torques(m, q, g, out)
    # angles of 1e6 rad are rounded to 1e-10
    assert_allclose(out, gravity_torque(m, q, g), rtol=0.0, atol=1e-7)


def test_threads_share_rows_without_changing_a_bit() -> None:
    m = model_of("random 8")
    q, _, _, g = states(m, 1000)
    assert (gravity_torque(m, q, g, threads=3) == gravity_torque(m, q, g, threads=2)).all()
    assert (
        gravity_torque(m, q, g[0], threads=3) == gravity_torque(m, q, g[:1].repeat(1000, 0), threads=2)
    ).all()
    assert_allclose(mass_matrix(m, q, threads=2), mass_matrix(m, q), rtol=0.0, atol=1e-11)
    with pytest.raises(InputError, match="threads"):
        write_gravity_torques(m, q, g, np.empty_like(q), threads=0)


def test_many_configurations_go_through_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    m = load_robot("raven2")
    q, _, _, g = states(m, 300)
    plain, matrices = gravity_torque(m, q, g), mass_matrix(m, q)
    monkeypatch.setattr("catenary.gravity.torque.MANY", 100)
    monkeypatch.setattr("catenary.dynamics.mass_matrix.MANY", 100)
    assert_allclose(gravity_torque(m, q, g), plain, rtol=0.0, atol=1e-12)
    assert_allclose(mass_matrix(m, q), matrices, rtol=0.0, atol=1e-12)
    assert kernels.MANY > 1000  # fewer are done before a kernel is compiled


@pytest.mark.parametrize("backend", ["llvm", "c"])
def test_kernels_take_any_layout_and_names(backend: Backend) -> None:
    kernel = gravity_kernel(load_robot("raven2"), backend=backend)
    q, g, out = np.array([0.5, 1.6, 0.4]), np.array([0.3, -0.2, -9.81]), np.empty(3)
    expected = kernel(q, g)
    assert_allclose(expected, gravity_torque(load_robot("raven2"), q, g), rtol=1e-12)
    apart = np.repeat(q, 2)[::2]
    for given in (
        kernel(list(q), list(g)),
        kernel(apart, g),
        kernel(q=q, gravity=g),
        kernel(apart, gravity=g),
    ):  # type: ignore[arg-type]
        assert (given == expected).all()
    assert kernel(q, g, out) is out
    assert (out == expected).all()
    out[:] = 0.0
    assert kernel(apart, g, out=out) is out
    assert (out == expected).all()
    for wrong in ({"q": q}, {"q": q, "gravity": g, "tau": out}):
        with pytest.raises(TypeError):
            kernel(**wrong)


@pytest.mark.parametrize("wrong", [2, 4])
def test_kernels_refuse_arrays_of_other_sizes(wrong: int) -> None:
    kernel = gravity_kernel(load_robot("raven2"))
    for sizes in ((wrong, 3, 3), (3, wrong, 3), (3, 3, wrong)):
        with pytest.raises(InputError, match=r"q \(3,\), gravity \(3,\), out \(3,\)"):
            kernel.into(*(np.zeros(size) for size in sizes))


def test_nan_reaches_the_torques_that_depend_on_it() -> None:
    kernel = gravity_kernel(load_robot("raven2"))
    level = np.array([0.0, 0.0, -9.81])
    assert np.isnan(kernel(np.array([0.1, np.nan, 0.3]), level)).all()
    assert np.isnan(kernel(np.array([0.1, 0.2, 0.3]), np.full(3, np.nan))).all()


def test_kernels_refuse_a_robot_without_inertia() -> None:
    model = replace(load_robot("raven2"), missing_inertia=("link",))
    for make in (gravity_kernel, mass_matrix_kernel, inverse_dynamics_kernel):
        with pytest.raises(MissingInertiaError):
            make(model)
    assert forward_kinematics_kernel(model)(np.zeros(3)).shape == (3, 4)


def test_a_robots_name_is_no_code() -> None:
    model = replace(load_robot("raven2"), name='"""\nraise SystemExit\n"""')
    assert gravity_kernel(model)(np.zeros(3), np.zeros(3)).shape == (3,)
