import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.payload import Payload, carrying


@pytest.mark.parametrize(
    ("payload", "complaint"),
    [
        (Payload(-1.0), "zero or more"),
        (Payload(np.nan), "finite"),
        (Payload(1.0, "nowhere"), "no frame"),
        (Payload(1.0, "base"), "fixed to the base"),
        (Payload(1.0, None, (0.0, 0.0)), "shape"),
    ],
)
def test_payloads_that_cannot_be_are_refused(payload, complaint):
    with pytest.raises(InputError, match=complaint):
        carrying(load_robot("two_link"), payload)


def test_no_payload_changes_nothing():
    model = load_robot("two_link")
    for before, after in zip(model.tree, carrying(model, Payload(0.0)).tree, strict=True):
        assert_array_equal(after, before)
