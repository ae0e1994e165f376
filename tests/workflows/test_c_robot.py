"""The law of motion in C: what Python computes, and what holds of any arm."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.dynamics.lines import inverse_dynamics_line
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.workflows.c_header import c_header
from compiled_c import LANGUAGES, output_of, prefix_of, puts
from oracles.catalogue import robots_with_inertia
from oracles.floating_base import Free, by_mujoco, by_pinocchio
from oracles.random_trees import random_robot, random_rotation

ROWS = 200
EXACT = 1e-12  # of a joint's largest: where terms cancel, a sum keeps that many digits of the largest of them
LONG = "dual_arm_19"  # its law takes gcc some seconds
ARMS = [pytest.param(a, marks=pytest.mark.slow) if a == LONG else a for a in robots_with_inertia()]


class Law(NamedTuple):
    """What a header gives on rows of motions, (N, ...)."""

    mass: Floats
    holding: Floats
    motion: Floats
    without_acceleration: Floats
    feedforward: Floats
    on_a_base_at_rest: Floats


def motions(model: RobotModel, seed: int, rows: int = ROWS) -> list[Floats]:
    """q, qd, qdd, gravity, omega, alpha, as rows."""
    rng = np.random.default_rng(seed)
    return [rng.normal(scale=s, size=(rows, k)) for s, k in ((3, model.n),) * 3 + ((5, 3), (1, 3), (2, 3))]


def law_in_c(model: RobotModel, given: list[Floats], folder: Path, language: str = "C99") -> Law:
    header, n = c_header(model).text, model.n
    name = prefix_of(header)
    q, qd, qdd, g, w, a = (f"r + {k}" for k in np.cumsum([0, n, n, n, 3, 3]))
    body = (
        f"  double M[{n * n}], h[{n}], t[{n}], b[{n}], f[{n}], s[{n}], z[{n}];\n  for (i = 0; i < {n}; ++i) z[i] = 0.0;\n"
        f"LOOP  {name}_mass_matrix({q}, M);\n  {name}_holding({q}, {g}, {w}, {a}, h);\n"
        f"  {name}_inverse_dynamics({q}, {qd}, {qdd}, {g}, {w}, {a}, t);\n"
        f"  {name}_inverse_dynamics({q}, {qd}, z, {g}, {w}, {a}, b);\n"
        f"  {name}_feedforward({q}, {qd}, {qdd}, {g}, {w}, {a}, f);\n"
        f"  {name}_feedforward({q}, {qd}, {qdd}, {g}, NULL, NULL, s);\n"
        + puts(M=n * n, h=n, t=n, b=n, f=n, s=n)
    )
    out = output_of(header, body, np.hstack(given), folder, language)
    M, *torques = np.split(out, np.cumsum([n * n] + [n] * 4), axis=1)
    return Law(M.reshape(-1, n, n), *torques)


def assert_close(found: Floats, expected: Floats, within: float = EXACT) -> None:
    """Compare torques (N, n), each to the largest that its joint takes in any row."""
    error, largest = np.abs(found - expected).max(axis=0), np.abs(expected).max(axis=0)
    assert (error <= within * largest).all(), (error, largest)


def assert_is_pythons(model: RobotModel, folder: Path, language: str, seed: int = 0) -> None:
    given = motions(model, seed)
    q, qd, qdd, gravity, omega, alpha = given
    law = law_in_c(model, given, folder, language)
    mass = mass_matrix(model, q)
    own = np.sqrt(np.diagonal(mass, axis1=1, axis2=2))  # M_ij^2 <= M_ii M_jj
    assert (np.abs(law.mass - mass) <= EXACT * own[:, :, None] * own[:, None, :]).all()
    base = BaseMotion(omega, alpha)
    expected = inverse_dynamics(model, q, qd, qdd, gravity, base)
    assert_close(law.motion, expected)
    assert_close(law.holding, inverse_dynamics(model, q, 0 * q, 0 * q, gravity, base))
    assert_close(law.feedforward, expected)
    assert_close(law.on_a_base_at_rest, inverse_dynamics(model, q, qd, qdd, gravity))
    # what holds of any arm, of the numbers of C alone
    assert_array_equal(law.mass, np.swapaxes(law.mass, 1, 2))
    # links without mass leave joints without inertia
    smallest = -EXACT * np.abs(law.mass).max() if model.massless else 0.0
    assert (np.linalg.eigvalsh(law.mass) > smallest).all()
    added = np.einsum("kij,kj->ki", law.mass, qdd)
    scale = np.abs(np.hstack([law.motion, law.without_acceleration])).max(axis=1, keepdims=True)
    assert_allclose((law.motion - law.without_acceleration - added) / scale, 0.0, atol=1e-11)  # a difference


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("arm", ARMS)
def test_the_law_of_a_catalogue_arm_is_pythons(arm: str, language: str, tmp_path: Path) -> None:
    assert_is_pythons(load_robot(arm), tmp_path, language)


FOLDER = [HealthCheck.function_scoped_fixture]  # each example writes its own files over the last one's


@given(seed=st.integers(0, 10_000))
@settings(max_examples=3, deadline=None, suppress_health_check=FOLDER)
def test_the_law_of_any_tree_is_pythons(seed: int, tmp_path: Path) -> None:
    assert_is_pythons(random_robot(seed).model, tmp_path, "C99", seed)


@pytest.mark.slow
@given(seed=st.integers(0, 1_000_000))
@settings(max_examples=12, deadline=None, suppress_health_check=FOLDER)
def test_the_law_of_many_trees_is_pythons(seed: int, tmp_path: Path) -> None:
    assert_is_pythons(random_robot(seed).model, tmp_path, "C99", seed)


@pytest.mark.parametrize("seed", [8, 12])
def test_on_a_moving_base_torques_are_what_a_floating_base_has_in_mujoco_and_pinocchio(
    seed: int, tmp_path: Path
) -> None:
    robot = random_robot(seed)
    rng = np.random.default_rng(seed)
    given, expected = motions(robot.model, seed, rows=5), []
    q, qd, qdd, gravity, omega, alpha = given
    felt = gravity.copy()
    for k in range(5):
        acceleration = rng.normal(size=3)
        base = Free(random_rotation(rng), rng.normal(size=3), BaseMotion(omega[k], alpha[k], acceleration))
        felt[k] = gravity[k] - acceleration
        row = robot, q[k], qd[k], qdd[k], gravity[k], base
        expected.append(by_pinocchio(*row))
        assert_allclose(by_mujoco(*row), expected[-1], atol=1e-9)  # they agree with each other
    law = law_in_c(robot.model, [q, qd, qdd, felt, omega, alpha], tmp_path)
    assert_close(law.feedforward, np.array(expected), 1e-11)  # their kinematics go another way round


def test_links_without_possible_inertia_leave_gravity_and_say_so() -> None:
    arm = load_robot("two_link")
    bare = c_header(replace(arm, missing_tensor=("link2",)))
    assert bare.functions == ("two_link_gravity", "two_link_gravity_regressor", "two_link_compact_regressor")
    assert "no possible inertia for link2, so gravity and its regressors alone" in bare.notes[0]
    assert "_inverse_dynamics(" not in bare.text


def test_the_law_of_nineteen_joints_takes_a_small_part_of_a_tick() -> None:
    # a nanosecond for each operation, which no processor of today needs, is 1 % of a tick of 1 ms
    assert inverse_dynamics_line(load_robot(LONG)).operations < 10_000
