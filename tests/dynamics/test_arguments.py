"""What all functions of a robot's motion do with batches, wrong arguments and missing inertia, those of gravity too."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.frame_motion import frame_motion
from catenary.dynamics.inverse_dynamics import (
    BaseMotion,
    coriolis_matrix,
    inverse_dynamics,
    mass_matrix,
    torque_derivatives,
)
from catenary.dynamics.kinematics import forward_kinematics, jacobian, link_poses
from catenary.dynamics.robot_kernels import (
    forward_kinematics_kernel,
    gravity_kernel,
    holding_kernel,
    inverse_dynamics_kernel,
    mass_matrix_kernel,
)
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.gravity_regressor import gravity_regressor, standard_gravity_regressor
from catenary.gravity.torque import (
    center_of_mass,
    center_of_mass_jacobian,
    gravity_delta,
    gravity_torque,
    potential_energy,
)
from catenary.robots.catalog import load_robot

RAVEN = load_robot("raven2")

FUNCTIONS = {
    forward_kinematics: ("q",),
    link_poses: ("q",),
    jacobian: ("q",),
    mass_matrix: ("q",),
    coriolis_matrix: ("q", "qd"),
    inverse_dynamics: ("q", "qd", "qdd", "gravity"),
    frame_motion: ("q", "qd", "qdd"),
    torque_derivatives: ("q", "qd", "qdd", "gravity"),
    torque_regressor: ("q", "qd", "qdd", "gravity"),
    gravity_torque: ("q", "gravity"),
    gravity_delta: ("q", "gravity"),
    potential_energy: ("q", "gravity"),
    center_of_mass: ("q",),
    center_of_mass_jacobian: ("q",),
    gravity_regressor: ("q", "gravity"),
    standard_gravity_regressor: ("q", "gravity"),
}
DYNAMICS = (mass_matrix, coriolis_matrix, inverse_dynamics, torque_derivatives)
NEED_INERTIA = (*DYNAMICS, gravity_torque, gravity_delta, potential_energy, center_of_mass, center_of_mass_jacobian)
KERNELS = (gravity_kernel, holding_kernel, inverse_dynamics_kernel, mass_matrix_kernel)
GOOD = {"q": [0.5, 1.5, 0.4], "qd": [0.0] * 3, "qdd": [0.0] * 3, "gravity": [0.0, 0.0, -9.81]}
MANY = {"q": [GOOD["q"]] * 2, "qd": [GOOD["qd"]] * 2, "qdd": [GOOD["qdd"]] * 2}


def called(function):
    return function.__name__


@pytest.mark.parametrize("function", FUNCTIONS, ids=called)
def test_batch_gives_what_single_configurations_give(function, random_robots, rng):
    for robot in random_robots[:9]:
        m = robot.model
        drawn = {key: rng.normal(size=(4, 3 if key == "gravity" else m.n)) for key in GOOD}
        rows = {key: drawn[key] for key in FUNCTIONS[function]}
        assert_rows(function, m, rows, [{key: row[k] for key, row in rows.items()} for k in range(4)])
        if "gravity" in rows:  # one for all
            level = {**rows, "gravity": drawn["gravity"][0]}
            singles = [{**{key: row[k] for key, row in rows.items()}, "gravity": level["gravity"]} for k in range(4)]
            assert_rows(function, m, level, singles)


def assert_rows(function, model, rows, singles) -> None:
    together = function(model, **rows)
    for k, single in enumerate(singles):
        alone = function(model, **single)
        for whole, one in zip(*((x if isinstance(x, tuple) else (x,)) for x in (together, alone)), strict=True):
            assert len(whole) == len(singles)
            assert_allclose(whole[k], one, rtol=0.0, atol=1e-14 * max(1.0, np.abs(one).max(initial=0.0)))


@pytest.mark.parametrize("function", FUNCTIONS, ids=called)
def test_an_empty_batch_gives_empty_results(function) -> None:
    rows = {key: np.empty((0, 3)) if key != "gravity" else GOOD[key] for key in FUNCTIONS[function]}
    found = function(RAVEN, **rows)
    assert all(len(part) == 0 for part in (found if isinstance(found, tuple) else (found,)))


REFUSED = [
    ("q", {"q": [0.0] * 2}, r"q: expected shape \(3,\) or \(N, 3\), got \(2,\)"),
    ("q", {"q": [0.0, 1.0, np.inf]}, r"q\[2\] is inf"),
    ("q", {**MANY, "q": [[0.0, np.nan, 0.3]]}, r"q\[0, 1\] is nan"),
    ("qd", {"qd": np.zeros((2, 3))}, r"qd: expected shape \(3,\), got \(2, 3\)"),
    ("qd", {"qd": [0.0, np.nan, 0.0]}, r"qd\[1\] is nan"),
    ("qdd", {**MANY, "qdd": [0.0] * 3}, r"qdd: expected shape \(2, 3\), got \(3,\)"),
    ("gravity", {"gravity": [0.0, -9.81]}, r"gravity: expected shape \(3,\)"),
    ("gravity", {"gravity": [np.nan, 0.0, 0.0]}, r"gravity\[0\] is nan"),
    ("gravity", {**MANY, "gravity": np.zeros((3, 3))}, r"gravity: expected .* \(2, 3\), as q has it, got \(3, 3\)"),
]  # fmt: skip


@pytest.mark.parametrize("function", FUNCTIONS, ids=called)
def test_wrong_arguments_are_refused_by_name(function) -> None:
    for name, changed, message in REFUSED:
        if name in FUNCTIONS[function]:
            arguments = {**GOOD, **changed}
            with pytest.raises(InputError, match=message):
                function(RAVEN, **{key: arguments[key] for key in FUNCTIONS[function]})


def test_what_single_functions_take_beside_is_checked_too() -> None:
    q = np.zeros(3)
    with pytest.raises(InputError, match=r"base angular acceleration\[1\] is inf"):
        inverse_dynamics(RAVEN, q, q, q, q, BaseMotion(angular_acceleration=(0.0, np.inf, 0.0)))
    for ask in (forward_kinematics, jacobian):
        with pytest.raises(InputError, match=r'no frame "hand"; frames: .*wrist'):
            ask(RAVEN, q, "hand")
    with pytest.raises(InputError, match="point"):
        jacobian(RAVEN, q, point=[0.0, 1.0])
    with pytest.raises(InputError, match='no frame "elsewhere"'):
        forward_kinematics_kernel(RAVEN, "elsewhere")


def test_a_model_without_inertia_has_kinematics_and_regressors_alone() -> None:
    model = replace(RAVEN, missing_inertia=("elbow", "insertion"))
    for function, names in FUNCTIONS.items():
        arguments = {key: GOOD[key] for key in names}
        if function in NEED_INERTIA:
            with pytest.raises(MissingInertiaError, match='"elbow", "insertion"') as caught:
                function(model, **arguments)
            assert caught.value.links == ("elbow", "insertion")
        else:
            function(model, **arguments)
    for make in KERNELS:
        with pytest.raises(MissingInertiaError):
            make(model)
    assert forward_kinematics_kernel(model)(np.zeros(3)).shape == (3, 4)
