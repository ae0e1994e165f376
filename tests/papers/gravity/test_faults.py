from pathlib import Path

import pytest

from catenary.arrays import Floats
from papers.gravity import faults
from papers.gravity.faults import LIMIT_DEG, Outcome, Start, main, outcome, ready, run

pytestmark = pytest.mark.slow
Ran = tuple[Start, list[Outcome], Path]
# what a person must be told of it; a fault of length or of a single sample has more than one true name
NAMED = {
    "drop_out": {"interrupted"},
    "not_finite": {"not_finite"},
    "stuck": {"stuck"},
    "wrong_sign": {"wrong_sign"},
    "spikes": {"spike"},
    "jump": {"jump"},
    "unit_g": {"unit_g"},
    "gravity_stripped": {"gravity_stripped"},
    "wrong_scale": {"magnitude", "jump"},
    "stamp_backwards": {"stamp_backwards"},
    "stamp_future": {"stamp_future"},
    "rates_not_finite": {"rate_not_finite"},
    "rates_stuck": {"rate_stuck"},
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("faults")
    start = ready()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(faults, "ready", lambda: start)
        return start, main(folder, tuple(NAMED), ("fade",)), folder


@pytest.fixture(scope="module")
def healthy(ran: Ran) -> Floats:
    return run(ran[0], None, "fade")[0]


def test_no_fault_of_the_sensor_moves_a_joint_by_half_a_degree(ran: Ran) -> None:
    worst = {row.fault: max(row.moved[:2]) for row in ran[1] if max(row.moved[:2]) > LIMIT_DEG}
    assert worst == {}


def test_every_fault_is_named_in_the_report(ran: Ran) -> None:
    unnamed = {row.fault: row.faults for row in ran[1] if not NAMED[row.fault] & set(row.faults)}
    assert unnamed == {}


@pytest.mark.parametrize("fallback", ["hold", "fade", "static"])
def test_configured_fallback_takes_the_place_of_lost_gravity(ran, healthy, fallback) -> None:
    row = outcome(ran[0], "drop_out", fallback, healthy)
    assert "fallback" in row.statuses
    assert max(row.moved[:2]) < LIMIT_DEG
    # on a tilted base level gravity is wrong by 1 Nm and more: 0.1 deg on 454 Nm/rad
    assert (row.moved[0] > 0.05) == (fallback == "static")


def test_stop_ends_the_motion_and_holds_the_arm(ran: Ran, healthy: Floats) -> None:
    row = outcome(ran[0], "drop_out", "stop", healthy)
    assert row.stopped
    assert row.statuses[-1] == "stop"
    assert max(row.moved[:2]) < LIMIT_DEG


def test_page_and_data_hold_every_outcome(ran: Ran, written) -> None:
    _, rows, folder = ran
    results, page = written(folder, "gravity_faults")
    assert [tuple(row["moved"]) for row in results] == [row.moved for row in rows]
    assert "did the sensor come loose" in page
