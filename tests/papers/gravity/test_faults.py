import pytest

from catenary.arrays import Floats
from papers.experiment import Outcomes, Scope
from papers.gravity.faults import LIMIT_DEG, Moved, Start, break_sensor, cases, follow, outcome, ready, report

Ran = tuple[Start, Floats, list[Moved]]
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
def ran() -> Ran:
    start = ready()
    healthy = follow(start, None, "fade")[0]
    return start, healthy, [outcome(start, kind, "fade", healthy) for kind in NAMED]


@pytest.mark.slow
def test_no_fault_of_the_sensor_moves_a_joint_by_half_a_degree(ran: Ran) -> None:
    worst = {row.fault: max(row.moved[:2]) for row in ran[2] if max(row.moved[:2]) > LIMIT_DEG}
    assert worst == {}


@pytest.mark.slow
def test_every_fault_is_named_in_the_report(ran: Ran) -> None:
    unnamed = {row.fault: row.faults for row in ran[2] if not NAMED[row.fault] & set(row.faults)}
    assert unnamed == {}


@pytest.mark.slow
@pytest.mark.parametrize("fallback", ["hold", "fade", "static"])
def test_configured_fallback_takes_the_place_of_lost_gravity(ran: Ran, fallback: str) -> None:
    row = outcome(ran[0], "drop_out", fallback, ran[1])
    assert "fallback" in row.statuses
    assert max(row.moved[:2]) < LIMIT_DEG
    # on a tilted base level gravity is wrong by 1 Nm and more: 0.1 deg on 454 Nm/rad
    assert (row.moved[0] > 0.05) == (fallback == "static")


@pytest.mark.slow
def test_stop_ends_the_motion_and_holds_the_arm(ran: Ran) -> None:
    row = outcome(ran[0], "drop_out", "stop", ran[1])
    assert row.stopped
    assert row.statuses[-1] == "stop"
    assert max(row.moved[:2]) < LIMIT_DEG


def made_up(moved: float, fallback: str, said: bool, *, stopped: bool = False) -> dict[str, object]:
    return {
        "fault": "jump",
        "fallback": fallback,
        "moved": [moved, 0.5 * moved, 2.0 * moved],
        "statuses": ["live", "stop" if stopped else "fallback"],
        "faults": ["jump"] if said else [],
        "messages": ["did the sensor come loose?"] if said else [],
        "stopped": stopped,
    }


def test_tables_hold_every_outcome_with_its_spread() -> None:
    found = {
        break_sensor.case(seed=seed, fallback=name, kinds=["jump"]): {
            "jump": made_up(moved, name, said=True, stopped=name == "stop")
        }
        for seed, moved in ((None, 0.1), (1, 0.2))
        for name in ("fade", "stop")
    }
    largest, whole, said = (one.table for one in report(Outcomes(found)).tables)
    assert largest.rows[0][:2] == ["fade", "0.200 deg, jump"]
    assert whole.rows[0][3:] == [
        "0.150 ± 0.071 deg, 0.300 ± 0.141 mm",
        "0.150 ± 0.071 deg, 0.300 ± 0.141 mm, stopped",
    ]
    assert said.rows == [["jump", "did the sensor come loose?"]]


def test_a_fault_that_is_not_named_is_said_to_be() -> None:
    (case,) = cases(Scope(quick=True))
    one = {"drop_out": made_up(0.6, "fade", said=False)}
    (remark,) = report(Outcomes({case: one})).remarks
    assert "0.600 deg, more than 0.5 deg" in remark
    assert remark.endswith("Not named in the report: drop_out.")


def test_every_robot_is_run_under_every_fallback() -> None:
    assert len(cases(Scope(robots=(None, 1, 2)))) == 12
