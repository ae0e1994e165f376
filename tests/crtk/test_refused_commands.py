"""Commands that make no sense, in both dialects: they move nothing and are reported."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from served_robot import JointState, ServedRobot

NONSENSE = {
    "NaN": np.full(7, np.nan),
    "infinite": np.full(7, np.inf),
    "six": np.full(6, 1e-3),
    "eight": np.full(8, 1e-3),
    "none": np.zeros(0),
}
OF_CRTK = [
    ("crtk", verb, {field: values})
    for verb, field in (("servo_jp", "position"), ("servo_jv", "velocity"), ("servo_jf", "effort"))
    for values in NONSENSE.values()
]
# of an increment with more than seven numbers the first seven count, and a single one is the grasp's
OF_RAVEN = [
    *(("raven", "servo_jr", {"position": NONSENSE[what]}) for what in ("NaN", "infinite", "six", "none")),
    *(("raven", "servo_jp", {"position": np.full(length, 0.5)}) for length in (2, 6, 8, 15)),
    ("raven", "servo_jr", {"name": tuple("abcdefg"), "position": np.full(7, 1e-3)}),
]


@pytest.mark.parametrize(("dialect", "verb", "fields"), OF_CRTK + OF_RAVEN)
def test_numbers_that_make_no_sense_move_nothing_and_are_reported(dialect, verb, fields) -> None:
    robot = ServedRobot(dialect)
    before = robot.setpoint
    robot.say(verb, JointState(**fields))
    robot.tick(5)
    assert_array_equal(robot.setpoint, before)
    assert robot.server.reports.count(f"/arm1/{verb}: refused") == 1
