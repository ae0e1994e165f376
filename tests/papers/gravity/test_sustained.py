import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import load_cable_arm
from catenary.workflows.gravity.simulated_arm import raven_gains
from papers.experiment import Outcomes, Scope
from papers.gravity import sustained

ARM = load_cable_arm()


def test_drives_as_believed_give_what_was_asked_for() -> None:
    assert_allclose(sustained.drive_gain(sustained.with_believed_drives(ARM)), np.eye(3), atol=1e-14)


def test_a_weak_drive_lets_the_joint_go_further_by_as_much() -> None:
    believed = sustained.with_believed_drives(ARM)
    weak = believed._replace(cable=believed.cable.replace(ratio_error=np.array([-0.1, 0.0, 0.0])))
    # true ratio 0.9 of the believed: 0.9 of the torque. Gravity's own stiffness, a hundredth, weighs a tenth more
    assert_allclose(
        sustained.frictionless(weak, "pd")[0] / sustained.frictionless(believed, "pd")[0],
        1.0 / 0.9,
        rtol=3e-3,
    )


def test_a_stiff_arm_of_ideal_drives_goes_by_the_missing_torque_over_kp() -> None:
    believed = sustained.with_believed_drives(ARM)
    stiff = believed._replace(
        cable=believed.cable.replace(stiffness=100.0 * believed.cable.stiffness),
        firmware=believed.firmware.replace(kp=100.0 * believed.firmware.kp),
    )
    expected = sustained.missing() / raven_gains(stiff.firmware).kp
    # gravity's own stiffness is 1e-4 of theirs
    assert_allclose(sustained.frictionless(stiff, "pd"), expected, rtol=2e-3)


def test_friction_that_is_none_keeps_a_joint_nowhere() -> None:
    assert sustained.friction_band(sustained.without_friction(ARM)) == 0.0
    assert sustained.friction_band(ARM) > 0.0


def test_report_has_a_row_for_every_run_and_controller() -> None:
    change = {
        "ideal": -0.1,
        "expected": -0.11,
        "band": 0.01,
        "simulated": -0.12,
        "time": [0.0, 1.0],
        "change": [0.0, -0.12],
    }
    outcomes = Outcomes({case: {"sg": change, "pd": change} for case in sustained.cases(Scope())})
    ((_, table),) = sustained.report(outcomes).tables
    assert len(table.rows) == 2 * len(sustained.RUNS)
    assert table.rows[2] == ["as it is, in 2 s, PD+SG", "-0.1100", "± 0.0100", "-0.1200", "1.100", "1.200"]
    assert sustained.report(Outcomes({})).tables == ()


@pytest.mark.slow
def test_without_friction_the_simulated_arm_goes_where_it_is_expected() -> None:
    free = sustained.accelerated(robot=sustained.NO_FRICTION, onset=sustained.ONSET, controllers=["sg"])["sg"]
    # expected is about the pose that is reported; the true one is 2 deg off
    assert_allclose(free["simulated"], free["expected"], rtol=0.03)
    assert free["simulated"] / free["ideal"] > 1.04  # by which the drives are weak


@pytest.mark.slow
def test_with_friction_it_comes_to_rest_within_what_friction_can_hold() -> None:
    held = sustained.accelerated(robot=sustained.AS_IT_IS, onset=sustained.ONSET, controllers=["sg"])["sg"]
    assert abs(held["simulated"] - held["expected"]) < 2.0 * held["band"]  # at either rest
    assert abs(held["simulated"] - held["largest"]) < 1e-3  # deg: it stays where it was carried
