from pathlib import Path

import pytest

from papers.gravity.passive import Held, as_rigid_bodies, main, neutral, on_cables

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("angle_deg", [25, 180])
def test_without_friction_sensed_gravity_holds_and_nominal_one_does_not(angle_deg: int) -> None:
    dg, sg = as_rigid_bodies(angle_deg, seconds=1.0)
    assert max(dg.drift) < 1e-3  # deg, mm: a torque of rounding alone
    # nothing sticks: on the same plant, from the same rest, half a second under a hundredth of a
    # joint's load moves it by more than that
    assert min(sg.drift) > 1.0


@pytest.mark.parametrize("angle_deg", [0, 25, 90, 180])
def test_with_sensed_gravity_every_pose_is_a_neutral_equilibrium(angle_deg: int) -> None:
    at = neutral(angle_deg)
    # gravity that were not cancelled would take a joint off by many times its displacement, or back past where it was
    assert at.distance < 1e-3
    # torques are held for a millisecond, and their changes late by that
    assert at.energy == pytest.approx(1.0, abs=0.01)


def test_simulated_raven_holds_upside_down_with_sensed_gravity_alone() -> None:
    dg, sg = on_cables(180, seconds=1.0)
    assert max(dg.drift[:2]) < 0.1
    assert sg.drift[0] > 5.0


def test_page_and_data_hold_every_angle(tmp_path: Path, written) -> None:
    rows = main(tmp_path, (25,), seconds=0.2, rigid_seconds=0.2)
    results, page = written(tmp_path, "gravity_passive")
    assert [Held(**row).controller for row in results["held"]] == [row.controller for row in rows]
    assert "section V-A" in page
