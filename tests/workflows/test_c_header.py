"""A robot and its calibration as C, against the Python that they are of."""

import re
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_file import save_model
from catenary.dynamics.actuation_loads import ActuationLoads, joint_friction, known_loads
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.dynamics.symbolic import inverse_dynamics_line
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.export import ExportedQuantity, export_function
from catenary.gravity.gravity_regressor import standard_gravity_regressor
from catenary.gravity.torque import gravity_torque
from catenary.identification.identification import identify
from catenary.identification.identification_file import identification_card, load_identification, save_identification
from catenary.identification.identify_options import IdentifyOptions
from catenary.kernels.bind import Step, run
from catenary.kernels.kernel import Kernel
from catenary.robots.actuation import Actuation, Friction, actuation_terms
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.sensing.tool_compensation import tool_line
from catenary.spatial import LEVEL
from catenary.workflows.c_header import c_correction, c_header
from command_line import catenary, refusal
from compiled_c import COMPILERS, LANGUAGES, output_of, prefix_of, puts
from moving_arm import recorded
from oracles.calibration_models import MIXED, random_model, ticked
from oracles.catalogue import robots_with_inertia
from oracles.every_load import every_load
from oracles.random_trees import random_robot
from oracles.sensed_tool import SensedTool

ROWS = 200
EXACT = 1e-12  # of a joint's largest: where terms cancel, a sum keeps that many digits of the largest of them
LONG = "dual_arm_19"  # its law takes gcc some seconds
# each in one of the languages: what they have in common is one text
ARMS = [
    pytest.param(arm, language, marks=pytest.mark.slow) if arm == LONG else (arm, language)
    for arm, language in zip(robots_with_inertia(), cycle(COMPILERS), strict=False)
]


def motions(model: RobotModel, seed: int, rows: int = ROWS) -> list[Floats]:
    """q, qd, qdd, gravity, omega, alpha, as rows."""
    rng = np.random.default_rng(seed)
    return [rng.normal(scale=s, size=(rows, k)) for s, k in ((3, model.n),) * 3 + ((5, 3), (1, 3), (2, 3))]


def assert_close(found: Floats, expected: Floats, within: float = EXACT) -> None:
    """Compare torques (N, n), each to the largest that its joint takes in any row."""
    error, largest = np.abs(found - expected).max(axis=0), np.abs(expected).max(axis=0)
    assert (error <= within * largest).all(), (error, largest)


def assert_is_pythons(model: RobotModel, folder: Path, language: str, seed: int = 0) -> None:
    rows, header, n = motions(model, seed), c_header(model).text, model.n
    name, sizes = prefix_of(header), {"M": n * n, "h": n, "t": n, "f": n}
    q, qd, qdd, g, w, a = (f"r + {k}" for k in np.cumsum([0, n, n, n, 3, 3]))
    body = (
        f"  double M[{n * n}], h[{n}], t[{n}], f[{n}];\n"
        f"LOOP  {name}_mass_matrix({q}, M);\n  {name}_holding({q}, {g}, {w}, {a}, h);\n"
        f"  {name}_inverse_dynamics({q}, {qd}, {qdd}, {g}, {w}, {a}, t);\n"
        f"  {name}_feedforward({q}, {qd}, {qdd}, {g}, {w}, {a}, f);\n{puts(**sizes)}"
    )
    out = output_of(header, body, np.hstack(rows), folder, language)
    M, holding, motion, feedforward = np.split(out, np.cumsum([*sizes.values()][:-1]), axis=1)
    M, (q, qd, qdd, gravity, omega, alpha) = M.reshape(-1, n, n), rows
    mass, base = mass_matrix(model, q), BaseMotion(omega, alpha)
    own = np.sqrt(np.diagonal(mass, axis1=1, axis2=2))  # M_ij^2 <= M_ii M_jj
    assert (np.abs(M - mass) <= EXACT * own[:, :, None] * own[:, None, :]).all()
    assert_array_equal(M, np.swapaxes(M, 1, 2))
    expected = inverse_dynamics(model, q, qd, qdd, gravity, base)
    assert_close(motion, expected)
    assert_close(holding, inverse_dynamics(model, q, 0 * q, 0 * q, gravity, base))
    assert_close(feedforward, expected)


@pytest.mark.alike
@pytest.mark.parametrize(("arm", "language"), ARMS)
def test_the_law_of_a_catalogue_arm_is_pythons(arm: str, language: str, tmp_path: Path) -> None:
    assert_is_pythons(load_robot(arm), tmp_path, language)


FOLDER = [HealthCheck.function_scoped_fixture]  # each example writes its own files over the last one's


@given(seed=st.integers(0, 10_000))
@settings(max_examples=3, deadline=None, suppress_health_check=FOLDER)
def test_the_law_of_any_tree_is_pythons(seed: int, tmp_path: Path) -> None:
    assert_is_pythons(random_robot(seed).model, tmp_path, "C99", seed)


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_tool_is_taken_out_as_in_python(language: str, tmp_path: Path) -> None:
    arm, wrist = load_robot("ur10e"), SensedTool(1, axes=np.eye(3)[[1, 2, 0]])
    tool, _ = wrist.weighed().weigh()
    q, qd, qdd, gravity, *_ = motions(arm, 3)
    rows = np.hstack([q, qd, qdd, gravity, np.random.default_rng(0).normal(size=(len(q), 12))])
    header = c_header(arm, tool=replace(tool, sign=-1.0))
    assert header.functions[-2:] == ("ur10e_tool_load", "ur10e_without_tool")
    arrays = ", ".join(f"r + {k}" for k in (0, 6, 12, 18, 21, 27))
    body = f"  double out[6];\nLOOP  ur10e_without_tool({arrays}, out);\n" + puts(out=6)
    found = output_of(header.text, body, rows, tmp_path, language)
    load = Kernel("load", tool_line(arm, tool), (6,)).rows(q, qd, qdd, gravity)
    assert_allclose(found, -(rows[:, 21:27] - tool.bias) - rows[:, 27:] - load, atol=1e-11)


def test_links_without_possible_inertia_leave_gravity_and_say_so() -> None:
    arm = load_robot("two_link")
    bare = c_header(replace(arm, missing_tensor=("link2",)))
    assert bare.functions == ("two_link_gravity", "two_link_standard_gravity_regressor", "two_link_compact_regressor")
    assert "no possible inertia for link2, so gravity and its regressors alone" in bare.notes[0]
    assert "_inverse_dynamics(" not in bare.text


def test_the_law_of_nineteen_joints_takes_a_small_part_of_a_tick() -> None:
    # a nanosecond for each operation, which no processor of today needs, is 1 % of a tick of 1 ms
    assert inverse_dynamics_line(load_robot(LONG)).operations < 10_000


ARM = load_robot("raven2")
LAST = ("friction", "drives", "feedforward")


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


@pytest.mark.parametrize("language", COMPILERS)
def test_rates_of_a_base_at_rest_may_be_null_in_every_function_of_the_header_and_of_exports(
    language: str, tmp_path: Path
) -> None:
    header, n = c_header(ARM).text, ARM.n
    quantities: tuple[ExportedQuantity, ...] = ("holding", "inverse_dynamics_on_moving_base")
    alone = "".join(export_function(replace(ARM, name="alone"), quantity, "c99") for quantity in quantities)
    takes = re.findall(r"static inline void (\w+)\(([^)]*)\bomega\b[^)]*\)", header + alone)
    assert len(takes) == 5  # holding, inverse_dynamics and feedforward; both exports
    given, body = motions(ARM, 3, rows=5), f"  double t[{n}];\nLOOP"
    at = {name: f"r + {k}" for name, k in zip(("q", "qd", "qdd", "gravity"), np.cumsum([0, n, n, n]), strict=True)}
    for function, before in takes:
        arrays = ", ".join(at[name] for name in re.findall(r"\*(\w+)", before))
        body += f"  {function}({arrays}, NULL, NULL, t);\n{puts(t=n)}"
    found = np.split(output_of(header + alone, body, np.hstack(given), tmp_path, language), 5, axis=1)
    q, qd, qdd, gravity = given[:4]
    for (function, _), torques in zip(takes, found, strict=True):
        rates = (0 * q, 0 * q) if "holding" in function else (qd, qdd)
        assert_close(torques, inverse_dynamics(ARM, q, *rates, gravity))


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("seed", [1, 12])
def test_actuation_in_c_is_pythons(seed: int, language: str, tmp_path: Path) -> None:
    model, rng = random_robot(seed).model, np.random.default_rng(seed)
    loads, n = every_load(model.n, rng, loaded=seed % 2 == 1, smooth=0.0 if seed % 2 else 0.02), model.n
    rows = np.hstack([rng.normal(size=(ROWS, 3 * n)), 5.0 * rng.normal(size=(ROWS, 3))])
    rows[:20, n : 2 * n] = 0.0  # at rest
    q, qd, qdd, gravity = np.split(rows, [n, 2 * n, 3 * n], axis=1)
    friction, drives, feedforward = torques_in_c(model, loads, rows, tmp_path, language)
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
    found = identify([recorded(ARM, 0)], ARM, IdentifyOptions(prior=False, friction=()))
    save_identification(found, identification_card(found, []), path)
    return path


def test_an_identified_robots_feedforward_is_what_its_identification_predicts(identified: Path, tmp_path: Path) -> None:
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
    assert written.json["functions"][-3:] == [f"{prefix_of((tmp_path / 'arm.h').read_text())}_{f}" for f in LAST]


def test_parameters_that_are_no_bodies_are_refused_with_the_way_out(tmp_path: Path) -> None:
    found = identify([recorded(ARM, 0)], ARM, IdentifyOptions(consistent=False, friction=()))
    with pytest.raises(MissingInertiaError):
        found.robot()
    save_identification(found, identification_card(found, []), tmp_path / "arm.npz")
    assert "identify once more without --free" in refusal("export", tmp_path / "arm.npz", "--c", tmp_path / "arm.h")


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


STATES = 4_000
GRAVITY_OF = [*map(load_robot, ("raven2", "raven2_full_right")), *(random_robot(seed).model for seed in (8, 17))]


GRAVITY = ("gravity", "standard_gravity_regressor", "compact_regressor")
MOTION = ("mass_matrix", "holding", "inverse_dynamics", "feedforward")


@pytest.mark.alike
@pytest.mark.parametrize(
    ("model", "language"),
    list(zip(GRAVITY_OF, cycle(COMPILERS), strict=False)),
    ids=lambda m: str(getattr(m, "name", m)),
)
def test_gravity_and_regressors_in_c_are_pythons(model: RobotModel, language: str, tmp_path: Path) -> None:
    header, compact = c_header(model).text, compact_regressor(model)
    n, p, s = model.n, 4 * len(model.link_names), len(compact.labels)
    name = prefix_of(header)
    body = (
        f"  double tau[{n}], Z[{n * p}], C[{n * s}];\nLOOP  {name}_gravity(r, r + {n}, tau);\n"
        f"  {name}_standard_gravity_regressor(r, r + {n}, Z);\n  {name}_compact_regressor(r, r + {n}, C);\n"
        + puts(tau=n, Z=n * p, C=n * s)
    )
    rng = np.random.default_rng(1)
    rows = np.column_stack([3.0 * rng.normal(size=(STATES, n)), 5.0 * rng.normal(size=(STATES, 3))])
    given = output_of(header, body, rows, tmp_path, language)
    expected = gravity_torque(model, rows[:, :n], rows[:, n:])
    bound = 1e-12 * max(1.0, np.abs(expected).max())  # of torques up to some 100 Nm
    assert_allclose(given[:, :n], expected, rtol=0.0, atol=bound)
    Z = standard_gravity_regressor(model, rows[:, :n], rows[:, n:]).reshape(STATES, -1)
    assert_allclose(given[:, n : n + n * p], Z, rtol=0.0, atol=1e-11)
    C = given[:, n + n * p :].reshape(STATES, n, s)
    assert_allclose(C, compact.Z(rows[:, :n], rows[:, n:]), rtol=0.0, atol=1e-11)
    for label in compact.labels:
        assert label in header


CASES: dict[str, dict] = {
    "constant": {},
    "linear": {"torques": 2},
    "quadratic": {"plays": 2, "coupled": 2},
    "tanh": {"plays": 3},
    "logistic": {"plays": 1, "torques": 1, "target": "position"},
    "tanh, skip": {"per_joint": True, "plays": 1},
    "logistic, skip": {"torques": 3},
    "expansion": {"plays": 2, "torques": 2, "coupled": 2, "along": True},
    MIXED: {"plays": 2, "torques": 1, "coupled": 3},
}


def calibration_of(kind: str, rng: np.random.Generator) -> tuple[CalibrationModel, np.ndarray]:
    """Draw a model of three joints, and a motion inside and outside of its valid range, with NaN here and there."""
    width = 3 + CASES[kind].get("torques", 0)
    signals = np.cumsum(0.1 * rng.normal(size=(STATES, width)), axis=0)
    model = random_model(kind, signals[: STATES // 2], rng, joints=3, **CASES[kind])
    if kind != "constant":  # which has none: NaN
        model = replace(model, intervals=Intervals(0.9, np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.2, 0.7])))
    signals[rng.integers(0, STATES, 50), rng.integers(0, width, 50)] = np.nan
    return model, signals


def corrected(header: str, rows: np.ndarray, n: int, folder: Path, language: str) -> np.ndarray:
    name = prefix_of(header)
    body = (
        f"  double out[{n}];\n  int inside[{n}];\n  {name}_state state;\n  {name}_reset(&state);\n"
        f"LOOP  {name}_correct(&state, r, r + {n}, out, inside);\n"
        f"  const double *interval = {name}_interval(&state);\n" + puts(out=n, inside=n, interval=n)
    )
    return output_of(header, body, rows, folder, language)


@pytest.mark.alike
@pytest.mark.parametrize(("kind", "language"), list(zip(CASES, cycle(COMPILERS), strict=False)))
def test_the_correction_in_c_is_the_correctors(kind: str, language: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    model, signals = calibration_of(kind, rng)
    q = signals[:, :3] + 0.01 * rng.normal(size=(STATES, 3))
    header = c_header(load_robot("raven2"), model, rate_hz=1000.0).text
    given = corrected(header, np.column_stack([q, signals]), 3, tmp_path, language)
    expected, inside = ticked(Corrector(model, rate_hz=1000.0), q, signals, widths := np.empty(q.shape))
    assert inside.any()
    assert not inside.all()
    assert (given[:, 3:6] == inside).all()
    assert_allclose(given[:, 6:], widths, rtol=1e-14)  # division before or after a product
    # networks of random weights: outputs of order ten
    assert_allclose(given[:, :3], expected, rtol=1e-12, atol=1e-12)


def test_c_carries_friction_states_bit_for_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    made = random_model("linear", rng.normal(size=(50, 3)), rng, joints=3, coupled=3)
    made = replace(made, features=replace(made.features, steps=tuple((f"q:j{k}", 5.0) for k in range(3))))
    rows = np.cumsum(rng.choice([0.01, 0.3, 2.0], (200, 1)) * rng.normal(size=(200, 3)), axis=0)
    rows[[50, 120], [0, 2]] += 9.0  # leaps that return
    rows[80, 1] = np.nan
    header, memory, expected = c_correction("arm", made), made.features.memory(), []
    for row in rows:
        arrays = (memory, np.empty((1, len(made.features.names))), np.ones(1), np.zeros(1, dtype=bool))
        run(made.features.row_steps(row[None], *arrays))
        expected.append(memory.friction.ravel().copy())
    body = (
        "  double out[3];\n  int inside[3];\n  arm_state state;\n  arm_reset(&state);\n"
        "LOOP  arm_correct(&state, r, r, out, inside);\n  for (i = 0; i < 24; ++i) PUT(state.friction[i]);\n"
    )
    header = f"#include <math.h>\n{header}"
    assert_array_equal(output_of(header, body, rows, tmp_path, "C99"), np.array(expected))


def test_check_values_in_the_comments_are_what_python_gives() -> None:
    model = load_robot("raven2")
    text = " ".join(c_header(model).text.split())
    found = re.search(r"To check: q = \(([^)]*)\), gravity = \(([^)]*)\) gives \(([^)]*)\)", text)
    assert found
    q, gravity, tau = ([float(word) for word in part.split(",")] for part in found.groups())
    assert_allclose(tau, gravity_torque(model, q, gravity), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("language", LANGUAGES)
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
    with pytest.raises(InputError, match="rate_hz: expected a positive rate"):
        c_header(robot, model, rate_hz=0.0)

    group = model.groups[0]

    class Forest(type(group.predictor)):
        """A predictor that somebody added."""

        def steps(self, X, Y, beyond=None):
            return [Step(trees, (X,), (Y,))]

    other = replace(model, groups=(replace(group, predictor=Forest(**vars(group.predictor))),))
    with pytest.raises(InputError, match="its step trees cannot be written as C"):
        c_correction("arm", other, 1)


def trees(X, Y):
    """A step that somebody added."""
    Y[:] = sorted(X)


def test_the_command_writes_the_header(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    model, _ = calibration_of("linear", rng)
    save_model(model, Card(), tmp_path / "model.npz")
    out = tmp_path / "raven2.h"
    outcome = catenary("export", "raven2", "--model", tmp_path / "model.npz", "--c", out, "--json")
    functions = [f"raven2_{name}" for name in (*GRAVITY, *MOTION, "reset", "correct", "interval")]
    assert outcome.json == {"file": str(out), "functions": functions}
    assert "independently" in outcome.err
    assert out.read_text() == c_header(load_robot("raven2"), model).text
