import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.crtk.outlet import quaternion
from catenary.spatial import rotation_from_quaternion, rotation_from_vector

turns = st.tuples(*[st.floats(-np.pi, np.pi)] * 3).map(np.array)


@settings(deadline=None)  # SciPy is loaded within the first example
@given(turns)
def test_a_quaternion_in_plain_arithmetic_is_the_rotation(turn):
    rotation = rotation_from_vector(turn)
    x, y, z, w = quaternion(rotation)
    assert_allclose(rotation_from_quaternion([w, x, y, z]), rotation, atol=1e-9)  # roots near a half turn
