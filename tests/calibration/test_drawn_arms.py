"""The learner against an afternoon's models, on a few drawn arms: with torque and without, of one recording and three."""

import numpy as np
import pytest

from drawn_arms import bench
from drawn_arms.arm import Arm


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 5])
def test_the_learner_beats_the_best_of_an_afternoons_models(seed: int) -> None:
    arm = Arm(seed)
    errors, best = bench.of_model(bench.learned(arm), arm), bench.of_baselines(arm)
    ratios = np.concatenate([errors[name] / best[name] for name in ("random", "task", "zigzag")])
    assert np.median(ratios) < 0.75
    assert np.mean(ratios > 1.05) <= 0.1
