"""Friction, rotors, springs and known torques in C: what Python computes, alone and within the feedforward."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import ActuationLoads, joint_friction, known_loads
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import MissingInertiaError
from catenary.identification.files import identification_card, load_identification, save_identification
from catenary.identification.identification import identify
from catenary.identification.options import IdentifyOptions
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    Spring,
    actuation_terms,
)
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.workflows.c_header import c_header
from command_line import catenary, refusal
from compiled_c import LANGUAGES, output_of, prefix_of, puts
from moving_arm import recorded
from oracles.random_trees import random_robot

ROWS = 200
ARM = load_robot("raven2")
LAST = ("friction", "drives", "feedforward")


def random_loads(n: int, rng: np.random.Generator, *, loaded: bool) -> ActuationLoads:
    """Two effects of every kind, on one coordinate and on a combination of all, with random numbers."""
    one, mixed = np.eye(n)[rng.integers(n)], rng.normal(size=n)
    lever = LeverSpring(0.01, 0.1, 0.06, float(rng.normal(scale=60.0)))
    actuation = Actuation(
        friction=(
            Friction("one", one, asymmetric=True, stribeck=0.3, load=loaded, presliding=0.01),
            Friction("mixed */ x", mixed, offset=False, load=loaded),
        ),
        motor_inertia=(MotorInertia("one", one), MotorInertia("mixed", mixed)),
        springs=(Spring("linear", mixed), Spring("lever", one, lever)),
        known_torques=(KnownTorque("cable", one, mixed, rng.normal(size=4)),),
        coulomb_velocity=float(rng.choice([0.0, 0.02])),
    )
    terms = actuation_terms(actuation)
    return ActuationLoads(n, actuation, terms, rng.normal(size=len(terms)))


def torques_in_c(model: RobotModel, loads: ActuationLoads, rows: np.ndarray, folder: Path, language: str):
    """Friction, drives, feedforward on a base at rest: (N, n) each."""
    header, n = c_header(model, loads=loads).text, model.n
    name = prefix_of(header)
    q, qd, qdd, g = (f"r + {k * n}" for k in range(4))
    carried = "c, " if loads.depends_on_load else ""
    body = (
        f"  double f[{n}], d[{n}], t[{n}], c[{n}], z[3] = {{0.0, 0.0, 0.0}};\n  int j;\nLOOP"
        f"  {name}_drives({q}, {qdd}, d);\n  {name}_inverse_dynamics({q}, {qd}, {qdd}, {g}, z, z, c);\n"
        f"  for (j = 0; j < {n}; ++j) c[j] += d[j];\n  {name}_friction({qd}, {carried}f);\n"
        f"  {name}_feedforward({q}, {qd}, {qdd}, {g}, NULL, NULL, t);\n" + puts(f=n, d=n, t=n)
    )
    return np.split(output_of(header, body, rows, folder, language), 3, axis=1)


def assert_are_pythons(seed: int, folder: Path, language: str) -> None:
    model, rng = random_robot(seed).model, np.random.default_rng(seed)
    loads, n = random_loads(model.n, rng, loaded=seed % 2 == 1), model.n
    rows = np.hstack([rng.normal(size=(ROWS, 3 * n)), 5.0 * rng.normal(size=(ROWS, 3))])
    rows[:20, n : 2 * n] = 0.0  # at rest
    q, qd, qdd, gravity = np.split(rows, [n, 2 * n, 3 * n], axis=1)
    friction, drives, feedforward = torques_in_c(model, loads, rows, folder, language)
    links = inverse_dynamics(model, q, qd, qdd, gravity)
    expected = loads.torque(q, qd, qdd, links)
    scale = 1e-12 * np.abs(expected).max() + 1e-12 * np.abs(links).max()
    assert_allclose(friction + drives, expected, rtol=0.0, atol=scale)
    if not loads.depends_on_load:
        offset = friction[0]  # at rest
        still = loads.torque(0 * q, 0 * qd, 0 * qdd)
        assert_allclose(friction, loads.torque(0 * q, qd, 0 * qdd) - still + offset, rtol=0.0, atol=scale)
    law = links + expected
    assert (np.abs(feedforward - law).max(axis=0) <= 1e-12 * np.abs(law).max(axis=0)).all()


@pytest.mark.parametrize("language", LANGUAGES)
def test_actuation_in_c_is_pythons(language: str, tmp_path: Path) -> None:
    for seed in (1, 12):
        assert_are_pythons(seed, tmp_path, language)


@pytest.mark.slow
@given(seed=st.integers(0, 1_000_000))
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_actuation_of_many_robots_is_pythons(seed: int, tmp_path: Path) -> None:
    assert_are_pythons(seed, tmp_path, "C99")


def test_nan_of_a_speed_stays_nan_in_friction(tmp_path: Path) -> None:
    model = load_robot("two_link")
    actuation = Actuation(friction=(Friction("a", np.eye(2)[0], viscous=False, offset=False),))
    loads = ActuationLoads(2, actuation, actuation_terms(actuation), np.array([1.5]))
    rows = np.zeros((1, 9))
    rows[0, 2] = np.nan
    friction, _, feedforward = torques_in_c(model, loads, rows, tmp_path, "C99")
    assert np.isnan([friction[0, 0], feedforward[0, 0]]).all()
    assert friction[0, 1] == 0.0


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("identified") / "arm.npz"
    found = identify([recorded(ARM, 0)], ARM, IdentifyOptions(consistent=True))
    save_identification(found, identification_card(found, []), path)
    return path


def test_an_identified_robots_feedforward_is_what_its_identification_predicts(
    identified: Path, tmp_path: Path
) -> None:
    found, _ = load_identification(identified)
    rng = np.random.default_rng(2)
    model = load_robot(identified)
    loads = known_loads(model)
    assert loads is not None
    n = model.n
    rows = np.hstack([rng.normal(size=(ROWS, 3 * n)), np.tile(LEVEL, (ROWS, 1))])
    _, _, feedforward = torques_in_c(model, loads, rows, tmp_path, "C99")
    expected = found.predict(*np.split(rows[:, : 3 * n], 3, axis=1))
    # base parameters are combinations of the links', rounded on the way
    assert_allclose(feedforward, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    written = catenary("export", identified, "--c", tmp_path / "arm.h", "--json")
    assert written.json["functions"][-3:] == [
        f"{prefix_of((tmp_path / 'arm.h').read_text())}_{f}" for f in LAST
    ]


def test_parameters_that_are_no_bodies_are_refused_with_the_way_out(tmp_path: Path) -> None:
    found = identify([recorded(ARM, 0)], ARM, IdentifyOptions(consistent=False))
    with pytest.raises(MissingInertiaError):
        found.robot()
    save_identification(found, identification_card(found, []), tmp_path / "arm.npz")
    assert "identify once more without --free" in refusal(
        "export", tmp_path / "arm.npz", "--c", tmp_path / "arm.h"
    )


def test_friction_given_by_hand_is_in_the_feedforward(tmp_path: Path) -> None:
    given = ("--friction", "0.5,0.4", "--viscous", "0.1", "--c", tmp_path / "arm.h")
    assert catenary("export", "two_link", *given).code == 0
    model = load_robot("two_link")
    loads = joint_friction(model, [0.5, 0.4], 0.1)
    assert (tmp_path / "arm.h").read_text() == c_header(model, loads=loads).text
    _, _, torque = torques_in_c(model, loads, np.array([[0, 0, 1.0, -2.0, 0, 0, 0, 0, 0]]), tmp_path, "C99")
    moving = inverse_dynamics(model, [0, 0], [1.0, -2.0], [0, 0], [0, 0, 0])  # unloaded by gravity
    assert_allclose(torque[0], moving + np.array([0.5 + 0.1, -0.4 - 0.2]), rtol=0.0, atol=1e-14)


def test_friction_that_would_be_lost_or_cannot_be_is_refused(tmp_path: Path) -> None:
    out = ("--c", tmp_path / "arm.h", "--friction")
    assert "expected zero or more" in refusal("export", "two_link", *out, "0.1,-0.1")
    assert "friction: expected shape (2,)" in refusal("export", "two_link", *out, "1,2,3")
    arm = load_robot("two_link")
    with pytest.raises(MissingInertiaError, match="link2"):
        c_header(replace(arm, missing_tensor=("link2",)), loads=joint_friction(arm, 1.0, 0.0))
