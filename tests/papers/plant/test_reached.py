import numpy as np

from papers.calibration.published import SIX_HOURS_LINEAR
from papers.experiment import Outcomes, Scope
from papers.plant import reached
from papers.plant.refit import parameters
from papers.plant.targets import DRIFT, FREE, FRICTION, TARGETS


def test_what_is_within_15_percent_is_reached() -> None:
    assert reached.verdict((1.1, 1.9, 3.0), (1.0, 2.0, 3.0)) == "reached"


def test_what_is_not_reached_is_named_with_how_far_it_is_off() -> None:
    assert reached.verdict((1.5, 2.0, 1.5), (1.0, 2.0, 3.0)) == "J1 +50%, J3 -50%"


def test_every_free_parameter_is_listed_with_its_bounds() -> None:
    rows = parameters(1.0, np.ones(len(FREE)), np.ones(len(DRIFT)))
    assert len(rows) == len(FRICTION) + len(FREE) + len(DRIFT)
    assert rows[0][-1] == f"{1.0 / FRICTION[0].factor:.2f} to {FRICTION[0].factor:.2f}"


def test_targets_that_are_met_are_reached() -> None:
    table_1, hours = (
        reached.table_1.case(test_seconds=1200.0),
        reached.hours.case(payload_kg=0.0, trained_loaded=True),
    )
    met = {
        "0": SIX_HOURS_LINEAR[0],
        "5": (9.0, 9.0, 9.0),
        "offset 0": (0.879, 1.056, 0.482),
        "offset 5": (1, 1.1, 0.5),
    }
    report = reached.report(Outcomes({table_1: TARGETS, hours: met}))
    assert [one.title for one in report.tables] == [
        "Table I, direction J2-J3",
        "Six hours of motion, unloaded and with 500 g",
    ]
    assert [row[-1] for row in report.tables[0].table.rows] == ["reached"] * 3
    assert report.tables[1].table.rows[0][-1] == "reached"
    assert report.tables[1].table.rows[1][-1] != "reached"


def test_all_targets_are_asked_for_and_quick_ones_are_few() -> None:
    assert len(reached.cases(Scope())) == 1 + 6 + 3 + 7 + 1 + 1
    assert len(reached.cases(Scope(quick=True))) == 2
