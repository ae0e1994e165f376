import json
from pathlib import Path

import pytest

from catenary.reproduce.gravity_faults import LIMIT_DEG, Outcome, Start, main, outcomes, ready
from catenary.simulation.sensors import FAULT_KINDS

pytestmark = pytest.mark.slow
# what a person must be told of each; a fault of length or of a single sample has more than one true name
NAMED = {
    "drop_out": {"interrupted"},
    "not_finite": {"not_finite"},
    "stuck": {"stuck"},
    "wrong_sign": {"wrong_sign"},
    "axes_swapped": {"axes_swapped"},
    "saturated": {"saturated"},
    "spikes": {"spike"},
    "jump": {"jump"},
    "unit_g": {"unit_g"},
    "unit_cm": {"unit_cm"},
    "gravity_stripped": {"gravity_stripped"},
    "wrong_scale": {"magnitude", "jump"},
    "stamp_backwards": {"stamp_backwards"},
    "stamp_repeated": {"stamp_repeated"},
    "stamp_future": {"stamp_future"},
    "rates_drop_out": {"rates_interrupted"},
    "rates_not_finite": {"rate_not_finite"},
    "rates_stuck": {"rate_stuck"},
    "rates_in_deg": {"rate_too_fast", "rate_spike", "rate_contradicts"},
}


@pytest.fixture(scope="module")
def start() -> Start:
    return ready()


@pytest.fixture(scope="module")
def faded(start: Start) -> list[Outcome]:
    return outcomes(start, FAULT_KINDS, ("fade",))


def test_no_fault_of_the_sensor_moves_a_joint_by_half_a_degree(faded: list[Outcome]) -> None:
    worst = {row.fault: max(row.moved[:2]) for row in faded if max(row.moved[:2]) > LIMIT_DEG}
    assert worst == {}


def test_every_fault_is_named_in_the_report(faded: list[Outcome]) -> None:
    unnamed = {row.fault: row.faults for row in faded if not NAMED[row.fault] & set(row.faults)}
    assert unnamed == {}


@pytest.mark.parametrize("fallback", ["hold", "static"])
def test_configured_fallback_takes_the_place_of_lost_gravity(start: Start, fallback: str) -> None:
    (row,) = outcomes(start, ("drop_out",), (fallback,))
    assert "fallback" in row.statuses
    assert max(row.moved[:2]) < LIMIT_DEG
    # on a tilted base level gravity is wrong by 1 Nm and more: 0.1 deg on 454 Nm/rad
    assert (row.moved[0] > 0.05) == (fallback == "static")


def test_stop_ends_the_motion_and_holds_the_arm(start: Start) -> None:
    (row,) = outcomes(start, ("drop_out",), ("stop",))
    assert row.stopped
    assert row.statuses[-1] == "stop"
    assert max(row.moved[:2]) < LIMIT_DEG


def test_page_and_data_hold_every_outcome(tmp_path: Path) -> None:
    rows = main(tmp_path, ("jump",), ("fade",))
    content = json.loads((tmp_path / "gravity_faults.json").read_text())
    assert [tuple(row["moved"]) for row in content["results"]] == [row.moved for row in rows]
    page = (tmp_path / "gravity_faults.html").read_text()
    assert "did the sensor come loose" in page
