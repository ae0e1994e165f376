import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.progress import silent
from catenary.gravity.torque import gravity_torque
from catenary.jobs.demo import (
    GRAVITY,
    LOWER,
    MODELS,
    UPPER,
    DemoResult,
    draw_cables,
    random_motion,
    run_demo,
    simulate_recording,
)
from catenary.robots.catalog import load_robot


def short_demo(folder: Path, seed: int = 0) -> DemoResult:
    return run_demo(folder, seed=seed, progress=silent, train_seconds=40.0, test_seconds=20.0)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> DemoResult:
    return short_demo(tmp_path_factory.mktemp("demo") / "new" / "folder")


def test_every_model_is_fitted_and_evaluated(demo: DemoResult) -> None:
    assert set(demo.evaluations) == set(MODELS)
    assert demo.model_path.is_file()


def test_the_same_seed_gives_the_same_errors(demo: DemoResult, tmp_path: Path) -> None:
    again = short_demo(tmp_path)
    for name, evaluation in demo.evaluations.items():
        assert again.evaluations[name].joints == evaluation.joints


def test_results_are_json_and_say_that_they_are_simulated(demo: DemoResult) -> None:
    content = json.loads((demo.page.parent / "results.json").read_text())
    assert content["simulated"] is True
    assert content["seed"] == 0
    assert set(content["models"]) == set(MODELS)


def test_the_page_compares_the_models_and_says_that_they_are_simulated(demo: DemoResult) -> None:
    page = demo.page.read_text()
    assert "Simulated: no real robot was measured" in page
    assert all(name in page for name in MODELS)


def test_another_seed_is_another_arm() -> None:
    first, second = (draw_cables(np.random.default_rng(seed)) for seed in (0, 1))
    assert not np.isclose(first.stiffness, second.stiffness).any()


def test_the_motion_stays_in_its_box() -> None:
    q = random_motion(60.0, np.random.default_rng(0))
    assert q.shape == (1800, 3)
    assert (q >= LOWER).all()
    assert (q <= UPPER).all()


def test_stiff_cables_without_friction_report_what_the_encoders_see() -> None:
    drawn = draw_cables(np.random.default_rng(0))
    none = np.zeros(3)
    cables = type(drawn)(
        stiffness=np.full(3, np.inf),
        ratio_error=none,
        friction=none,
        slack=drawn.slack,
        run_out=none,
        registration=none,
    )
    log = simulate_recording("ideal", cables, 10.0, np.random.default_rng(0))
    assert_allclose(log.q_nominal, log.q_encoder, atol=1e-15)


def test_torques_hold_gravity() -> None:
    drawn = draw_cables(np.random.default_rng(0))
    log = simulate_recording("run", drawn, 60.0, np.random.default_rng(0))
    assert log.tau is not None
    assert log.q_encoder is not None
    left = log.tau - gravity_torque(load_robot("raven2"), log.q_encoder, GRAVITY)
    # friction, and five standard deviations of 2 % noise
    assert (np.abs(left) <= drawn.friction + 0.1 * np.abs(log.tau).mean(axis=0)).all()
