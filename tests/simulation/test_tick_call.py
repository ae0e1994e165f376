from copy import deepcopy

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.simulation.base_motion import FixedBase, RockingBase
from catenary.simulation.cable_parameters import varied
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.packed import CABLE, FIRMWARE, TREE, pack, pack_tree
from oracles.cable_arms import homed_plant


def state(plant):
    return np.concatenate([*plant.state, *plant.control])


@pytest.mark.parametrize("base", [FixedBase(0.1, -0.2), RockingBase(0.0, 0.2, 1.0)])
def test_a_tick_by_itself_is_a_tick_of_a_run_to_the_last_bit(base):
    ticked = CablePlant(seed=3, base=base)
    ticked.home()
    ran = deepcopy(ticked)
    rows = ran.setpoint_js().q + 1e-4 * np.cumsum(
        np.random.default_rng(1).uniform(-1.0, 1.0, (50, 7)), axis=0
    )
    ran.run(rows)
    for row in rows:
        ticked.servo_jp(row)
        ticked.wait()
    assert_array_equal(state(ticked), state(ran))


def test_a_copy_ticks_for_itself():
    plant = homed_plant("left")
    plant.wait()
    twin, before = deepcopy(plant), state(plant)
    twin.servo_jr(np.full(7, 1e-4))
    for _ in range(20):
        twin.wait()
    assert_array_equal(state(plant), before)
    assert (state(twin) != before).any()


def test_parameters_that_are_replaced_are_those_of_the_next_tick():
    changed, fresh = homed_plant("left"), homed_plant("left")
    cable = varied(changed.arm, np.random.default_rng(2)).cable
    changed.wait(), fresh.wait()
    twin = deepcopy(fresh)
    for plant in (changed, twin):
        plant.cable = cable
    for plant in (changed, twin, fresh):
        plant.servo_jr(np.full(7, 1e-4))
        for _ in range(20):
            plant.wait()
    assert_array_equal(state(changed), state(twin))
    assert (state(changed) != state(fresh)).any()


def test_a_base_whose_rows_lie_strangely_in_memory_is_stood_upon():
    class Strange(FixedBase):
        def sample(self, times):
            gravity, motion = super().sample(times)
            return type(super().sample(times))(
                np.asfortranarray(np.tile(gravity, (len(times), 1))), np.tile(motion, (len(times), 1, 1))
            )

    strange, plain = (CablePlant(seed=3, base=base) for base in (Strange(0.1), FixedBase(0.1)))
    for _ in range(5):
        strange.wait(), plain.wait()
    assert_array_equal(state(strange), state(plain))


def test_other_arrays_are_refused_before_anything_happens():
    plant = CablePlant(seed=3)
    plant.wait()
    before = state(plant)
    with pytest.raises(InputError, match="other arrays"):
        plant._tick_call(np.zeros(6), np.zeros((1, 3)), np.zeros((1, 3, 3)))
    assert_array_equal(state(plant), before)


def test_numbers_are_packed_in_the_sizes_that_a_tick_reads():
    plant = CablePlant()
    assert (len(pack(plant.cable)), len(pack(plant.firmware)), len(pack_tree(plant._tree))) == (
        CABLE,
        FIRMWARE,
        TREE,
    )
