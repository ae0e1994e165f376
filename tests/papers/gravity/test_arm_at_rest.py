"""The simulated RAVEN-II at rest on tilted and accelerated bases, held against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.workflows.gravity_trials import RAVEN_START, raven_gains
from papers.experiment import Result
from papers.gravity.passive import neutral
from papers.gravity.raven_base import Z0, turned_base
from papers.gravity.static_poses import HOME, static
from papers.gravity.steps import CuedBase, homed, respond


def run(approach: str, angle_deg: float, poses_deg: list[float]) -> Result:
    return static(seed=None, angle_deg=angle_deg, approach=approach, poses_deg=poses_deg)


@pytest.mark.slow
def test_driven_arm_leaves_its_friction_to_the_pd() -> None:
    tilted = run("driven", 25, [37.0])
    # 0.15 + 0.16 Nm and a tenth of the load, of 2 to 3 Nm
    assert abs(tilted["dg"]["feedback"][0][0]) < 0.25 * abs(tilted["dg"]["torque"][0][0])
    error = {name: abs(tilted[name]["error"][0][0]) for name in tilted}
    assert error["dg"] < error["sg"] < error["pd"]
    # the terms are those of the base's gravity at the pose, less what PD alone sags by
    gravity = turned_base(25).sample(np.zeros(1)).gravity[0]
    expected = gravity_torque(load_robot("raven2"), np.array([np.deg2rad(37.0), *HOME]), gravity)
    assert_allclose(tilted["pd"]["dg"][0], expected, rtol=0.02, atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [25, 180])
def test_with_sensed_gravity_every_pose_is_a_neutral_equilibrium(angle_deg: int) -> None:
    at = neutral(angle_deg=angle_deg, seconds=1.0)
    # gravity that were not cancelled would take a joint off by many times its displacement, or back past where it was
    assert at["distance"] < 1e-3
    # torques are held for a millisecond, and their changes late by that
    assert at["energy"] == pytest.approx(1.0, abs=0.01)


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
