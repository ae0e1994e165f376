import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.robots.plausibility import gravity_doubts
from catenary.sensing.gravity_vector import (
    FixedGravity,
    Kind,
    Mailbox,
    ReadingStatus,
    tilt_angle,
    tilt_of,
    tilted_gravity,
)


def test_samples_are_taken_in_the_order_in_which_they_came():
    mailbox = Mailbox()
    mailbox.put(1.0, [1, 2, 3], Kind.SPECIFIC_FORCE)
    mailbox.put(0.5, [4, 5, 6], Kind.ANGULAR_RATE)
    assert len(mailbox) == 2
    assert mailbox.take() == (1.0, (1.0, 2.0, 3.0), Kind.SPECIFIC_FORCE)
    assert mailbox.take() == (0.5, (4.0, 5.0, 6.0), Kind.ANGULAR_RATE)
    assert mailbox.take() is None


def test_a_full_mailbox_drops_the_oldest_and_counts_them():
    mailbox = Mailbox(3)
    for k in range(5):
        mailbox.put(k, [0.0, 0.0, 0.0], Kind.FREE_FALL)
    assert mailbox.dropped == 2
    assert mailbox.take().stamp == 2.0


def test_what_a_thread_puts_another_takes_without_loss():
    mailbox, taken = Mailbox(100_000), []

    def write():
        for k in range(20_000):
            mailbox.put(k, [k, k, k], Kind.SPECIFIC_FORCE)

    writer = threading.Thread(target=write)
    writer.start()
    while writer.is_alive() or len(mailbox):
        sample = mailbox.take()
        if sample is not None:
            taken.append(sample.stamp)
    writer.join()
    assert taken == list(range(20_000))


ANGLE = st.floats(-1.5, 1.5)


@given(roll=ANGLE, pitch=ANGLE)
def test_tilted_gravity_is_the_vertical_seen_from_a_base_that_rolled_then_pitched(roll, pitch):
    R_world_base = Rotation.from_euler("XY", [roll, pitch]).as_matrix()
    assert_allclose(tilted_gravity(roll, pitch), R_world_base.T @ [0.0, 0.0, -9.81], atol=1e-13)


@given(roll=ANGLE, pitch=st.floats(-3.1, 3.1))
def test_tilt_is_read_back_from_gravity(roll, pitch):
    assert_allclose(tilt_of(tilted_gravity(roll, pitch)), (roll, pitch), atol=1e-9)  # asin near 86 degrees


@given(roll=ANGLE, pitch=ANGLE)
def test_tilt_angle_is_the_angle_to_the_vertical(roll, pitch):
    cosine = np.cos(roll) * np.cos(pitch)
    assert_allclose(np.cos(tilt_angle(tilted_gravity(roll, pitch))), cosine, atol=1e-12)


def test_a_fixed_source_says_what_it_was_told_and_that_nothing_was_measured():
    source = FixedGravity([1.0, 2.0, -9.0])
    source.read(0.0).gravity[:] = 0.0  # a reading is the receiver's own
    reading = source.read(3.0)
    assert_array_equal(reading.gravity, [1.0, 2.0, -9.0])
    assert_array_equal(reading.base_rates, np.zeros((2, 3)))
    assert reading.age == np.inf
    assert reading.status is ReadingStatus.NOMINAL
    assert not reading.faults


@pytest.mark.parametrize("gravity", [[0.0, 1.0], [0.0, 0.0, np.nan]])
def test_vectors_that_are_none_are_refused(gravity):
    with pytest.raises(InputError, match="gravity"):
        FixedGravity(gravity)


def test_no_vector_has_no_tilt():
    with pytest.raises(InputError, match="not zero"):
        tilt_of([0.0, 0.0, 0.0])
    assert np.isnan(tilt_angle([0.0, 0.0, 0.0]))


@given(roll=ANGLE, pitch=st.floats(-1.5, 1.5), strength=st.floats(9.76, 9.83))
def test_gravity_anywhere_on_earth_is_not_doubted(roll, pitch, strength):
    assert gravity_doubts(tilted_gravity(roll, pitch) * strength / 9.81) == []


def test_gravity_that_is_hardly_meant_is_doubted_and_logged(caplog):
    for vector, said in (
        ([0.0, 0.0, -1.62], "magnitude of 1.62 m/s2"),  # the Moon's
        ([0.0, 0.0, 9.81], "points up"),  # an accelerometer's reading
        ([0.0, 0.0, 0.0], "magnitude of 0 m/s2"),
    ):
        FixedGravity(vector)
        assert said in caplog.records[-1].getMessage()
    assert gravity_doubts([0.0, 0.0, 9.81], hanging=True) == []
    FixedGravity()
    assert len(caplog.records) == 3
