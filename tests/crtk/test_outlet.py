import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.crtk.conversions import pose_of
from catenary.crtk.message import header
from catenary.crtk.outlet import pose_stamped, transform_stamped
from catenary.spatial import rotation_from_vector

turns = st.tuples(*[st.floats(-np.pi, np.pi)] * 3).map(np.array)


@given(turns)
def test_poses_survive_their_messages(turn):
    rotation, position = rotation_from_vector(turn), np.array([0.1, -0.2, 0.3])
    for message in (
        pose_stamped(header(1), rotation, position),
        transform_stamped(header(1), rotation, position, "tool"),
    ):
        pose = pose_of(message)
        assert_allclose(pose.rotation, rotation, atol=1e-9)  # roots near a half turn
        assert_allclose(pose.position, position)
