import numpy as np
from numpy.testing import assert_array_equal

from catenary.robots.catalog import load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_physics import new_state
from catenary.simulation.firmware import new_control, new_log
from catenary.simulation.packed import (
    ARM,
    CONTROL,
    CONTROL_WHOLE,
    LOG,
    arm_of,
    cable_of,
    control_of,
    firmware_of,
    log_of,
    pack,
    pack_tree,
    tree_of,
)


def _assert_same(a: tuple[np.ndarray, ...], b: tuple[np.ndarray, ...]) -> None:
    for left, right in zip(a, b, strict=True):
        assert_array_equal(left, right)


def _numbered(arrays: tuple[np.ndarray, ...], rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    return type(arrays)._make(rng.normal(size=a.shape) if a.dtype == float else a for a in arrays)


def test_parameters_come_back_from_their_long_arrays() -> None:
    arm = load_cable_arm()
    _assert_same(cable_of(pack(arm.cable)), arm.cable)
    _assert_same(firmware_of(pack(arm.firmware)), arm.firmware)


def test_a_tree_comes_back_from_its_long_array() -> None:
    tree = load_robot("raven2").tree
    _assert_same(tree_of(tree.parent, tree.prismatic, pack_tree(tree)), tree)


def test_states_come_back_from_their_long_arrays() -> None:
    rng = np.random.default_rng(0)
    state, control = _numbered(new_state(), rng), _numbered(new_control(), rng)
    whole = np.concatenate([a for a in control if a.dtype == np.int64])
    assert (len(pack(state)), len(pack(control)), len(whole)) == (ARM, CONTROL, CONTROL_WHOLE)
    _assert_same(arm_of(pack(state)), state)
    _assert_same(control_of(pack(control), whole), control)


def test_a_log_is_views_of_its_table() -> None:
    table = np.random.default_rng(0).normal(size=(5, LOG))
    log = log_of(table)
    assert [a.shape for a in log] == [a.shape for a in new_log(5)]
    assert_array_equal(np.hstack(log), table)
