"""Six hours: errors of joints and tip against other ways to them, and what a tiny session comes to."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import MotionLog
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import Target
from catenary.dynamics.kinematics import jacobian
from catenary.robots.catalog import load_robot
from papers.calibration.recordings import METHODS, NETWORK, SETS, fitted, rows_of, unguarded
from papers.calibration.sessions import CONDITIONS, HOURS, denominators
from papers.calibration.six_hours import (
    GROUPS,
    LONG,
    SHORT,
    cases_of,
    joint_rmse,
    left_by,
    measured,
    six_hours,
    tip_rmse,
)
from papers.experiment import Outcomes, Scope


def a_log(rng: np.random.Generator, rows: int = 200) -> MotionLog:
    q = rng.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (rows, 3))
    tau = rng.normal(size=(rows, 3))
    tools = ("roll", "wrist", "jaw1", "jaw2", "unused")
    signals = {f"q:{tool}": rng.normal(0.0, 0.3, rows) for tool in tools} | {
        f"tau:{tool}": rng.normal(size=rows) for tool in tools
    }
    return MotionLog(
        name="made up",
        joint_names=("shoulder", "elbow", "insertion"),
        joint_units=("rad", "rad", "m"),
        q_nominal=q,
        q_encoder=q + 0.01 * tau + 0.02,
        ok=np.ones(rows, dtype=bool),
        tau=tau,
        signals=signals,
        signal_units=dict.fromkeys(signals, "rad"),
    )


def test_tip_error_of_small_joint_errors_is_that_of_the_jacobian(rng: np.random.Generator) -> None:
    log = a_log(rng)
    left = 1e-6 * rng.normal(size=(len(log), 3))
    jaws = (log.signals["q:jaw2"] - log.signals["q:jaw1"]) / 2.0
    q = np.column_stack([np.asarray(log.q_encoder), log.signals["q:roll"], log.signals["q:wrist"], jaws])
    moved = np.einsum("nij,nj->ni", jacobian(load_robot("raven2_full"), q)[:, :3, :3], left)
    # reported rounded to 1e-6 mm
    assert_allclose(tip_rmse(log, left)[:3], 1e3 * np.sqrt(np.mean(moved**2, axis=0)), atol=2e-6)
    x, y, z, distance = tip_rmse(log, 1e3 * left)
    assert_allclose(distance, np.sqrt(x**2 + y**2 + z**2), rtol=1e-4)


@pytest.mark.parametrize("target", ["error", "position"])
def test_without_a_guard_a_model_is_its_predictor_and_with_it_the_same_where_it_knows_the_ground(
    target: Target, rng: np.random.Generator
) -> None:
    train, test = a_log(rng), a_log(rng)
    model = fitted([train], FitOptions(kind="linear", inputs=METHODS["linear"].inputs, target=target))
    data = rows_of(model, test)
    known = model.inside(data.X).all(axis=1)
    assert known.any()
    # the made-up error is linear in the torques
    free = left_by(unguarded(model), data)
    assert_allclose(free, 0.0, atol=1e-9)
    assert_allclose(left_by(model, data)[known], free[known], atol=1e-12)


def test_errors_are_in_degrees_and_millimetres() -> None:
    assert_allclose(joint_rmse(np.tile([np.pi / 180.0, np.pi / 90.0, 0.003], (5, 1))), [1.0, 2.0, 3.0])


def test_training_sets_are_all_those_no_longer_than_the_three_coarsest_in_order_of_their_length() -> None:
    # [s], of the zig-zags of J2-J3 one by one; joining two costs a few seconds
    seconds = {2: 203.0, 3: 328.0, 4: 483.0, 5: 670.0, 6: 888.0}
    lengths = [sum(seconds[n] for n in denominators(name)) for name in SETS]
    assert lengths == sorted(lengths)
    assert all(length < 500.0 for length in lengths[: len(SHORT)])
    assert all(length > 800.0 for length in lengths[-len(LONG) :])
    assert {name for group in GROUPS for name in group} == set(SETS)


def test_a_case_has_each_condition_once_and_its_results_are_found_again() -> None:
    scope = Scope(robots=(None, 1), networks=1)
    cases = cases_of(scope, models=("linear",))
    assert len(cases) == 2 * len(CONDITIONS) * len(GROUPS)

    def made_up(arguments: dict[str, Any]) -> dict[str, Any]:
        seed = arguments["seed"] or 0
        return {
            "linear": {
                name: [
                    {"errors": [seed, hour, len(name)], "tip": [1.0] * 4}
                    for hour in HOURS[arguments["condition"]]
                ]
                for name in arguments["sets"]
            }
        }

    outcomes = Outcomes({case: made_up(case.arguments) for case in cases})
    found = measured(outcomes, "idle", "linear")
    assert found.shape == (2, len(SETS), 2, 3)
    assert_allclose(found[1, :, 1], [[1.0, 5.0, len(name)] for name in SETS])
    assert measured(outcomes, "loaded", "linear", SHORT, kind="tip").shape == (2, 3, 6, 4)
    assert measured(outcomes, "loaded", "linear", target="position").size == 0


@pytest.mark.slow
def test_models_halve_what_the_offset_leaves_in_a_tiny_session() -> None:
    found = six_hours(
        None, "idle", ["1/2"], ["linear", NETWORK], [0], "error", "16", zigzags=[2], hour_seconds=120.0
    )
    for hour in range(2):
        offset, linear = (np.array(found[name]["1/2"][hour]["errors"]) for name in ("fixed offset", "linear"))
        assert (linear < 0.5 * offset).all()
