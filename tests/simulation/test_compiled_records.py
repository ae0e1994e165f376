import copy
import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.kernels.compiled import compiled
from catenary.simulation.compiled_records import CodePerAxis, PerJoint, Record


class Drive(Record):
    speed: PerJoint
    mode: CodePerAxis
    gain: float
    on: bool


@compiled
def double(drives: Drive) -> None:
    for k in range(len(drives)):
        drive = drives[k]
        for j in range(3):
            drive.speed[j] *= 2.0
        drive.mode[6] += 1
        drive.gain *= 2.0
        drive.on = not drive.on


def test_compiled_code_reads_and_writes_the_fields_that_python_sees() -> None:
    drives = Drive.rows(2)
    drives.speed[:] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    drives.gain[1] = 0.5
    double(drives)
    assert_array_equal(drives.speed, [[2.0, 4.0, 6.0], [8.0, 10.0, 12.0]])
    assert_array_equal(drives.mode[:, 6], [1, 1])
    assert_array_equal(drives.gain, [0.0, 1.0])
    assert_array_equal(drives.on, [True, True])


def test_a_field_that_is_not_given_is_zero() -> None:
    drive = Drive(gain=2.0)
    assert_array_equal(drive.speed, 0.0)
    assert (drive.gain, drive.on) == (2.0, False)


@pytest.mark.parametrize(
    "twin_of",
    [copy.deepcopy, lambda r: r.copy(), lambda r: r.replace(on=True), lambda r: pickle.loads(pickle.dumps(r))],
)
def test_a_copy_has_fields_of_its_own(twin_of) -> None:
    drive = Drive(speed=[1.0, 2.0, 3.0])
    twin = twin_of(drive)
    twin.speed[0] = 9.0
    twin.gain = 1.0
    assert isinstance(twin, Drive)
    assert_array_equal(drive.speed, [1.0, 2.0, 3.0])
    assert drive.gain == 0.0


@pytest.mark.parametrize(
    ("fields", "message"), [({"speed": np.zeros(4)}, "broadcast"), ({"sped": np.zeros(3)}, "sped")]
)
def test_fields_that_do_not_fit_are_refused(fields, message) -> None:
    with pytest.raises(ValueError, match=message):
        Drive(**fields)


def test_a_field_that_numpy_would_hide_is_refused() -> None:
    with pytest.raises(TypeError, match="named flags"):

        class Hidden(Record):
            flags: PerJoint
