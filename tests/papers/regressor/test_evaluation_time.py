import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_regressor, load_robot
from papers.regressor.evaluation_time import evaluation, full_kernel, medians


@pytest.mark.parametrize("name", ["planar_3r", "ur5e", "dvrk_mtm_motors"])
def test_full_regressor_as_a_line_of_operations_is_the_papers(name: str, rng: np.random.Generator) -> None:
    model = load_robot(name)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    expected = gravity_regressor(model, q, gravity)
    assert_allclose(full_kernel(model)(q, gravity), expected, atol=1e-12 * np.abs(expected).max())


def test_times_are_medians_of_calls_in_turns() -> None:
    def slow() -> float:
        return sum(k * 0.5 for k in range(2000))

    quick, long = medians([lambda: None, slow], 3)
    assert 0.0 < quick < long


def test_a_case_tells_both_times_and_that_the_forms_are_right() -> None:
    found = evaluation(robot="planar_3r", repeats=2)
    assert found["ratio"] == pytest.approx(found["full_us"] / found["compact_us"])
    assert found["difference"] < 1e-12
