import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.devices.encoder_rig import EncoderRig
from catenary.errors import InputError


def test_a_quarter_turn_and_a_centimetre_from_the_stops():
    zero = np.array([100.0, -200.0, 300.0])
    counts = zero + np.array([20_000.0, -20_000.0, -2000.0])
    # 80,000 counts a turn, 5 um a count; 0, 130 deg and 572.467 mm at the stops
    expected = np.array([np.deg2rad(90.0), np.deg2rad(40.0), 0.562467])
    assert_allclose(EncoderRig().positions(counts, zero), expected, rtol=1e-12)
    assert_allclose(EncoderRig().positions(np.tile(counts, (4, 1)), zero), np.tile(expected, (4, 1)))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"bits": 20}, "expected one of"),
        ({"side": np.array([0.0, 1.0, 1.0])}, "expected 1 or -1"),
        ({"window": np.array([0.0, 1.0, 1.0])}, "expected more than 0"),
        ({"counts": np.ones(2)}, "shape"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(options, said):
    with pytest.raises(InputError, match=said):
        EncoderRig(**options)
