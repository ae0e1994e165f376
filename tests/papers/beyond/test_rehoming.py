import numpy as np
from numpy.testing import assert_allclose

from papers.beyond import rehoming
from papers.beyond.registration import registrations
from papers.beyond.rehoming import (
    BACK,
    CORNER,
    FIRST,
    HARMFUL,
    MODELS,
    NOTHING,
    OFFSET,
    PARTED,
    SHOWN,
    offset_errors,
    order_errors,
)
from papers.experiment import NOMINAL, Outcomes, Result, Scope


def result(function: object, order: str | None) -> Result:
    if function is registrations:
        travel = [0.0, 0.0, 10.0, 20.0]
        trace = {"time": [0.0, 1.0], "true": [0.0, -0.5], "shoulder_s": 0.5}
        return {
            "coupling_error": 0.05,
            "travel": travel,
            "shift": [0.04 * each for each in travel],
            "left": [0.0, 0.0, 0.1, 0.6],
            "traces": {"home pose": trace, "corner of the box": trace},
        }
    if function is offset_errors:
        return {order: {cure: errors(order) for cure in (PARTED, OFFSET)} for order in HARMFUL}
    assert order is not None
    return {cure: errors(order) for cure in ((NOTHING, BACK) if order in HARMFUL else (NOTHING,))}


def errors(order: str) -> dict[str, list[list[float]]]:
    after = 0.7 if order == CORNER else 0.21
    return {name: [[0.1, 0.2, 0.1], [0.1, after, 0.1]] for name in MODELS}


def made_up() -> Outcomes:
    cases = rehoming.cases(Scope(robots=(NOMINAL, 1)))
    return Outcomes({case: result(case.load(), case.arguments.get("order")) for case in cases})


def test_every_cure_of_every_robot_is_there() -> None:
    cases = rehoming.cases(Scope(robots=(NOMINAL, 1)))
    assert len(cases) == len(set(cases)) == 2 * 6
    for order, cure in SHOWN:
        assert rehoming.errors(made_up(), order, cure, "linear").shape == (2, 2)


def test_report_tells_how_much_of_joint_2s_registration_is_explained() -> None:
    report = rehoming.report(made_up())
    mechanism, cures = (one.table for one in report.tables)
    assert [row[:3] + row[3:5] for row in mechanism.rows] == [
        ["nominal", "0.0500", "2 of 4", "0.80", "1.000"],
        ["1", "0.0500", "2 of 4", "0.80", "1.000"],
    ]
    assert len(cures.rows) == len(SHOWN) * len(MODELS)
    (sentence,) = report.remarks
    assert "0.700" in sentence
    assert "100 %" in sentence
    assert len(report.pictures[0].figure.axes) == 3


def test_cures_are_compared_on_joint_2() -> None:
    assert_allclose(rehoming.errors(made_up(), CORNER, NOTHING, "network")[:, 1], 0.7)
    assert_allclose(rehoming.errors(made_up(), FIRST, NOTHING, "network")[:, 1], 0.21)
    assert len(rehoming.errors(Outcomes({}), FIRST, NOTHING, "network")) == 0


def test_cases_are_of_functions_that_are_there() -> None:
    functions = {case.load() for case in rehoming.cases(Scope(robots=(NOMINAL,), networks=1, quick=True))}
    assert functions == {registrations, order_errors, offset_errors}
    assert np.isfinite(rehoming.EXPERIMENT.minutes)
