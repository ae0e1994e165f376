import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.arithmetic import Step
from catenary.calibration.c_source import c_correction
from catenary.calibration.corrector import Corrector
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_file import save_model
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.workflows.c_header import c_header
from command_line import catenary
from compiled_c import LANGUAGES, output_of, prefix_of, puts
from oracles.calibration_models import MIXED, random_model, random_network
from oracles.random_trees import random_robot

STATES = 4_000
ROBOTS = [*map(load_robot, ("raven2", "raven2_full_right")), *(random_robot(seed).model for seed in (8, 17))]


@pytest.fixture(params=LANGUAGES)
def language(request: pytest.FixtureRequest) -> str:
    """Each language that the header is to compile as."""
    return request.param


GRAVITY = ("gravity", "gravity_regressor", "compact_regressor")
MOTION = ("mass_matrix", "holding", "inverse_dynamics", "feedforward")


@pytest.mark.parametrize("model", ROBOTS, ids=lambda m: m.name)
def test_gravity_and_regressors_in_c_are_pythons(model: RobotModel, language: str, tmp_path: Path) -> None:
    header, compact = c_header(model).text, compact_regressor(model)
    n, p, s = model.n, 4 * len(model.link_names), len(compact.labels)
    name = prefix_of(header)
    body = (
        f"  double tau[{n}], Z[{n * p}], C[{n * s}];\nLOOP  {name}_gravity(r, r + {n}, tau);\n"
        f"  {name}_gravity_regressor(r, r + {n}, Z);\n  {name}_compact_regressor(r, r + {n}, C);\n"
        + puts(tau=n, Z=n * p, C=n * s)
    )
    rng = np.random.default_rng(1)
    rows = np.column_stack([3.0 * rng.normal(size=(STATES, n)), 5.0 * rng.normal(size=(STATES, 3))])
    given = output_of(header, body, rows, tmp_path, language)
    expected = gravity_torque(model, rows[:, :n], rows[:, n:])
    bound = 1e-12 * max(1.0, np.abs(expected).max())  # of torques up to some 100 Nm
    assert_allclose(given[:, :n], expected, rtol=0.0, atol=bound)
    # m, mx, my, mz of every link
    tree = model.tree
    parameters = np.column_stack([tree.mass, tree.mass[:, None] * tree.com]).ravel()
    Z = given[:, n : n + n * p].reshape(STATES, n, p)
    assert_allclose(Z @ parameters, expected, rtol=0.0, atol=10 * bound)
    for k in range(len(tree.mass)):  # each link's columns are its own
        mass, com = np.zeros_like(tree.mass), np.zeros_like(tree.com)
        mass[k], com[k] = 2.0, rng.normal(size=3)
        one = replace(model, tree=tree._replace(mass=mass, com=com))
        alone = gravity_torque(one, rows[0, :n], rows[0, n:])
        columns = slice(4 * k, 4 * k + 4)
        assert_allclose(Z[0, :, columns] @ [2.0, *(2.0 * com[k])], alone, rtol=0.0, atol=10 * bound)
    C = given[:, n + n * p :].reshape(STATES, n, s)
    assert_allclose(C, compact.Z(rows[:, :n], rows[:, n:]), rtol=0.0, atol=1e-11)
    for label in compact.labels:
        assert label in header


CASES: dict[str, dict] = {
    "constant": {},
    "linear": {"torques": 2},
    "quadratic": {"plays": 2},
    "tanh": {"history": 3},
    "logistic": {"history": 2, "plays": 1, "torques": 1, "target": "position"},
    "tanh, skip": {"per_joint": True, "history": 1, "plays": 1},
    "logistic, skip": {"torques": 3},
    MIXED: {"history": 1, "plays": 2, "torques": 1},
}


def calibration_of(kind: str, rng: np.random.Generator) -> tuple[CalibrationModel, np.ndarray]:
    """Draw a model of three joints, and a motion inside and outside of its valid range, with NaN here and there."""
    width = 3 + CASES[kind].get("torques", 0)
    signals = np.cumsum(0.1 * rng.normal(size=(STATES, width)), axis=0)
    model = random_model(kind, signals[: STATES // 2], rng, joints=3, rate_hz=500.0, **CASES[kind])
    if kind != "constant":  # which has none: NaN
        model = replace(model, intervals=Intervals(0.9, np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.2, 0.7])))
    signals[rng.integers(0, STATES, 50), rng.integers(0, width, 50)] = np.nan
    return model, signals


def half_widths(model: CalibrationModel, q: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Take the ticks of a corrector, which give half-widths of intervals."""
    corrector, widths = Corrector(model, rate_hz=1000.0), np.empty(q.shape)
    out, inside = np.empty(q.shape[1]), np.empty(q.shape[1], dtype=bool)
    for k in range(len(q)):
        corrector.correct(q[k], signals[k], out, inside, widths[k])
    return widths


def corrected(header: str, rows: np.ndarray, n: int, folder: Path, language: str) -> np.ndarray:
    name = prefix_of(header)
    body = (
        f"  double out[{n}];\n  int inside[{n}];\n  {name}_state state;\n  {name}_reset(&state);\n"
        f"LOOP  {name}_correct(&state, r, r + {n}, out, inside);\n"
        f"  const double *interval = {name}_interval(&state);\n" + puts(out=n, inside=n, interval=n)
    )
    return output_of(header, body, rows, folder, language)


@pytest.mark.parametrize("kind", CASES)
def test_the_correction_in_c_is_the_correctors(kind: str, language: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    model, signals = calibration_of(kind, rng)
    q = signals[:, :3] + 0.01 * rng.normal(size=(STATES, 3))
    header = c_header(load_robot("raven2"), model, rate_hz=1000.0).text
    given = corrected(header, np.column_stack([q, signals]), 3, tmp_path, language)
    expected, inside = Corrector(model, rate_hz=1000.0).run(q, signals)
    assert inside.any()
    assert not inside.all()
    assert (given[:, 3:6] == inside).all()
    assert_allclose(given[:, 6:], half_widths(model, q, signals), rtol=1e-14)  # division before or after a product
    # networks of random weights: outputs of order ten
    assert_allclose(given[:, :3], expected, rtol=1e-12, atol=1e-12)


def test_the_papers_network_is_exported(language: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    signals = rng.normal(size=(STATES, 16))
    model = random_model("linear", signals, rng, joints=8, torques=8)
    network = random_network((16, 100, 100, 8), "tanh", rng)
    model = replace(model, groups=(replace(model.groups[0], predictor=network),))
    header = c_header(load_robot("raven2"), model)
    assert "none of the robot's" in header.notes[0]  # joints of another robot are told of
    given = corrected(header.text, np.column_stack([signals[:, :8], signals]), 8, tmp_path, language)
    expected, _ = Corrector(model).run(signals[:, :8], signals)
    assert_allclose(given[:, :8], expected, rtol=1e-12, atol=1e-12)


def test_check_values_in_the_comments_are_what_python_gives() -> None:
    model = load_robot("raven2")
    text = " ".join(c_header(model).text.split())
    found = re.search(r"To check: q = \(([^)]*)\), gravity = \(([^)]*)\) gives \(([^)]*)\)", text)
    assert found
    q, gravity, tau = ([float(word) for word in part.split(",")] for part in found.groups())
    assert_allclose(tau, gravity_torque(model, q, gravity), rtol=0.0, atol=1e-13)


def test_names_from_files_cannot_leave_the_comments(language: str, tmp_path: Path) -> None:
    name = 'arm */ #error "x" \n\\'
    joints, links = ("a*/b", "c\nd"), ("*/ int x;", "??/")
    model = replace(load_robot("two_link"), name=name, joint_names=joints, link_names=links)
    body = f"LOOP  PUT(r[0]); (void){prefix_of(c_header(model).text)}_gravity;\n"
    output_of(c_header(model).text, body, np.zeros((1, 1)), tmp_path, language)


def test_what_cannot_be_exported_is_refused_with_a_reason(tmp_path: Path) -> None:
    robot = load_robot("raven2")
    with pytest.raises(MissingInertiaError, match="link"):
        c_header(replace(robot, missing_inertia=("link",)))
    rng = np.random.default_rng(5)
    model, _ = calibration_of("tanh", rng)
    with pytest.raises(InputError, match="more than 3% off"):
        c_header(robot, model, rate_hz=730.0)

    group = model.groups[0]

    class Forest(type(group.predictor)):
        """A predictor that somebody added."""

        def steps(self, X, Y):
            return [Step(trees, (X,), (Y,))]

    other = replace(model, groups=(replace(group, predictor=Forest(**vars(group.predictor))),))
    with pytest.raises(InputError, match="its step trees cannot be written as C"):
        c_correction("arm", other, 1)


def trees(X, Y):
    """A step that somebody added."""


def test_the_command_writes_the_header(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    model, _ = calibration_of("linear", rng)
    save_model(model, Card(), tmp_path / "model.npz")
    out = tmp_path / "raven2.h"
    outcome = catenary("export", "raven2", "--model", tmp_path / "model.npz", "--c", out, "--json")
    functions = [f"raven2_{name}" for name in (*GRAVITY, *MOTION, "reset", "correct", "interval")]
    assert outcome.json == {"file": str(out), "functions": functions}
    assert "side by side" in outcome.err
    assert out.read_text() == c_header(load_robot("raven2"), model).text
