from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.simulation.cable_parameters import load_cable_arm
from catenary.workflows.gravity.simulated_arm import raven_gains
from papers.gravity import sustained

ARM = load_cable_arm()
Driven = tuple[list[sustained.Change], Path]


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


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Driven:
    folder = tmp_path_factory.mktemp("sustained")
    return sustained.main(folder, (sustained.CASES[0], sustained.CASES[2]), ("sg",)), folder


@pytest.mark.slow
def test_without_friction_the_simulated_arm_goes_where_it_is_expected(driven: Driven) -> None:
    free = driven[0][1]
    # expected is about the pose that is reported; the true one is 2 deg off
    assert_allclose(free.simulated, free.expected, rtol=0.03)
    assert free.simulated / free.ideal > 1.04  # by which the drives are weak


@pytest.mark.slow
def test_with_friction_it_comes_to_rest_within_what_friction_can_hold(driven: Driven) -> None:
    held = driven[0][0]
    assert abs(held.simulated - held.expected) < 2.0 * held.band  # at either rest
    assert abs(held.simulated - held.response.largest) < 1e-3  # deg: it stays where it was carried


@pytest.mark.slow
def test_page_and_data_hold_every_case(driven: Driven, written) -> None:
    changes, folder = driven
    results, page = written(folder, "gravity_sustained")
    assert [row["case"] for row in results] == [change.case for change in changes]
    assert "no friction" in page
