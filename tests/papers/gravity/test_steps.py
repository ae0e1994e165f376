import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.workflows.gravity.motions import RAVEN_START
from catenary.workflows.gravity.simulated_arm import raven_gains
from papers.experiment import NOMINAL, Outcomes, Scope
from papers.gravity.events import CuedBase, homed, respond
from papers.gravity.raven_base import Z0
from papers.gravity.steps import CONTROLLERS, cases, report


def test_report_has_a_row_for_every_controller_and_event() -> None:
    one = {
        "before": 0.1,
        "rise_time": 0.2,
        "overshoot": 0.3,
        "largest": 0.4,
        "final": 0.5,
        "last_error": 0.6,
        "time": [0.0, 1.0],
        "error": [0.1, 0.0],
        "moved": [0.0, 0.1],
    }
    outcomes = Outcomes({case: dict.fromkeys(CONTROLLERS, one) for case in cases(Scope(robots=(NOMINAL, 1)))})
    steps, bases = report(outcomes).tables
    assert steps.table.rows[0] == ["PD", *(f"{x} ± 0.000" for x in ("0.100", "0.200", "0.300", "0.600"))]
    assert len(bases.table.rows) == 2 * len(CONTROLLERS)
    assert report(Outcomes({})).tables == []


def test_a_cued_base_turns_as_its_rates_say() -> None:
    base = CuedBase(turn=0.3, turn_time=0.5)
    base.begin = 1.0
    times = np.arange(0.9, 1.7, 1e-5)
    gravity, motion = base.sample(times)
    assert_allclose(np.linalg.norm(gravity, axis=1), 9.81, rtol=1e-12)
    # seen from axes that turn, what stands still changes by -omega x
    change = np.gradient(gravity, times, axis=0)[1:-1]
    assert_allclose(change, -np.cross(motion[:, 0], gravity)[1:-1], atol=1e-4)
    assert_allclose(np.gradient(motion[:, 0], times, axis=0)[1:-1], motion[1:-1, 1], atol=2e-3)
    assert_allclose(np.trapezoid(motion[:, 0] @ Z0, times), 0.3, atol=1e-6)


def test_a_base_that_was_not_cued_stands_level() -> None:
    gravity, motion = CuedBase(turn=0.3, acceleration=2.0).sample(np.array([0.0, 1e4]))
    assert_allclose(gravity, np.tile([0.0, 0.0, -9.81], (2, 1)))
    assert not motion.any()


@pytest.mark.slow
def test_an_accelerometer_knows_sustained_acceleration_and_an_inclinometer_does_not() -> None:
    plant = homed("drive")
    dg, attitude = (respond(plant, "drive", name) for name in ("dg", "attitude"))
    model = load_robot("raven2")
    missing = gravity_torque(model, RAVEN_START, [-2.0, 0.0, 0.0])[0]  # 2 m/s2 along x
    expected = np.rad2deg(missing / raven_gains(load_cable_arm().firmware).kp[0])
    # friction may hold a joint short of that place, or have held it before
    assert 0.5 < attitude.final / expected < 1.5
    assert abs(dg.final) < 0.25 * abs(attitude.final)
