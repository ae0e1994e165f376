from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.payload import Payload, load_directions
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from oracles.random_trees import random_robot


@pytest.mark.parametrize("seed", range(12))
def test_a_body_on_any_link_asks_for_the_torque_that_the_directions_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = random_robot(seed).model
    regressor = compact_regressor(model)
    frame = model.link_names[rng.integers(len(model.link_names))]
    mass, place = 1.7, rng.normal(size=3)
    directions = load_directions(regressor, frame)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    loaded = Payload(mass, frame, place).on(model)
    more = gravity_torque(loaded, q, gravity) - gravity_torque(model, q, gravity)
    assert_allclose(regressor.Z(q, gravity) @ directions @ np.array([mass, *(mass * place)]), more, atol=1e-9)


def test_a_frames_own_place_on_its_link_counts() -> None:
    model = load_robot("dual_arm_19")
    regressor = compact_regressor(model)
    before, after = (regressor.parameters(robot) for robot in (model, Payload(2.0, "left_hand").on(model)))
    directions = load_directions(regressor, "left_hand")
    assert_allclose(2.0 * directions[:, 0], after - before, atol=1e-12)


def test_what_the_structure_cannot_hold_is_left_out() -> None:
    model = load_robot("planar_3r")  # centres of mass on the x axes only
    assert_allclose(load_directions(compact_regressor(model), model.link_names[-1])[:, 2:], 0.0)


def test_a_load_on_the_base_is_refused() -> None:
    model = load_robot("planar_3r")
    frames = {**model.frames, "table": model.frames[model.tip]._replace(link=-1)}
    with pytest.raises(InputError, match='frame "table" is fixed to the base'):
        load_directions(compact_regressor(replace(model, frames=frames)), "table")
