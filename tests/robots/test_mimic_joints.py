import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import UnsupportedModelError
from catenary.robots.mimic_joints import Mimic, resolve_mimics

factors = st.tuples(st.floats(-3, 3), st.floats(-3, 3))


@given(st.lists(factors, min_size=1, max_size=5), st.floats(-2, 2))
def test_a_resolved_chain_gives_what_following_it_step_by_step_gives(chain, q):
    names = [f"j{i}" for i in range(len(chain) + 1)]  # j1 follows j0, j2 follows j1, ...
    mimics = {names[i + 1]: Mimic(names[i], m, o) for i, (m, o) in enumerate(chain)}
    resolved = resolve_mimics(dict(reversed(mimics.items())))
    position = q
    for name, (multiplier, offset) in zip(names[1:], chain, strict=True):
        position = multiplier * position + offset
        assert resolved[name].leader == "j0"
        assert_allclose(resolved[name].multiplier * q + resolved[name].offset, position, atol=1e-9)


def test_a_chain_may_end_at_a_constant():
    resolved = resolve_mimics({"a": Mimic("b", 2.0, 0.1), "b": Mimic(None, 0.0, 0.5)})
    assert resolved["a"] == Mimic(None, 0.0, 1.1)


def test_a_loop_is_refused_even_when_entered_from_outside():
    with pytest.raises(UnsupportedModelError, match='joint "a" follows itself: a -> b -> c -> b'):
        resolve_mimics({"a": Mimic("b", 1, 0), "b": Mimic("c", 1, 0), "c": Mimic("b", 1, 0)})
