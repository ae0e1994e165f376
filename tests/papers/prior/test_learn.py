"""The recipe of the prior, on few arms."""

import json
from pathlib import Path

import numpy as np

from catenary.calibration.feature_prior import Prior, load_prior
from papers.prior.arms import drawn_arm
from papers.prior.learn import SEED, arm, first_prior, learn, main, over_ridge


def test_arms_are_drawn_by_their_seed_and_differ() -> None:
    one, same, other = (drawn_arm(np.random.default_rng(seed), 50) for seed in (1, 1, 2))
    assert one.q_encoder is not None
    assert same.q_encoder is not None
    np.testing.assert_array_equal(one.q_encoder, same.q_encoder)
    assert other.q_nominal.shape != one.q_nominal.shape or not np.allclose(other.q_nominal, one.q_nominal)
    assert np.isfinite(one.q_encoder).all()


def test_what_is_learnt_does_better_on_arms_that_it_has_not_seen() -> None:
    unseen = [arm(SEED + 5000 + k) for k in range(4)]
    assert np.exp(np.log(over_ridge(unseen, load_prior("simulated"))).mean()) < 0.98


def test_a_round_learns_that_own_features_weigh_more() -> None:
    prior = learn([arm(SEED + k) for k in range(4)], first_prior(4))
    assert prior.own["q"] > prior.other["q"]


def test_the_recipe_writes_a_file_that_the_package_reads(tmp_path: Path) -> None:
    main([str(tmp_path / "prior.json"), "--arms", "2", "--rounds", "1", "--unseen", "1"])
    assert Prior(**json.loads((tmp_path / "prior.json").read_text())).robots == 2
