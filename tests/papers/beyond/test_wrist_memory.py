import numpy as np

from papers.beyond import wrist_memory
from papers.calibration import dvrk
from papers.experiment import Outcomes, Scope


def made_up() -> Outcomes:
    """Return results in which play states leave a quarter, the recurrent network a half, the network all."""
    left = {"fixed offset": 8.0, "neural, paper": 8.0, "linear, play": 2.0, "neural, best": 1.0}
    results = {}
    for case in wrist_memory.cases(Scope(networks=2)):
        told = case.arguments
        off = 0.1 * told["seed"]
        if "peer" in told:
            results[case] = {told["peer"]: {"rmse": [4.0 + off] * 6, "outside": 0.0}}
        else:
            results[case] = {
                name: {"rmse": [left.get(name, 9.0) + off] * 6, "outside": 0.0}
                for name in (
                    *dvrk.variants(told["kind"]),
                    *(("fixed offset",) if told["kind"] == "linear" else ()),
                )
            }
    return Outcomes(results)


def test_the_cases_are_those_of_the_dvrk_experiment() -> None:
    scope = Scope(networks=2)
    assert set(wrist_memory.cases(scope)) < set(dvrk.cases(scope))
    assert len(wrist_memory.cases(scope)) == 4 * (1 + 2 + 2 + 2)


def test_shares_are_of_the_fixed_offset_recording_by_recording() -> None:
    found = wrist_memory.shares(made_up())
    assert list(found) == list(wrist_memory.SHOWN)
    np.testing.assert_allclose(found["linear, play"], np.full((4, 3), 0.25))
    np.testing.assert_allclose(found[dvrk.RECURRENT], np.full((4, 3), 4.05 / 8.0))


def test_the_sentence_and_the_tables_hold_every_model() -> None:
    report = wrist_memory.report(made_up())
    assert "after the linear, play states 25 % (25 to 25)" in report.remarks[0]
    assert "after the recurrent, 4 commands 51 %" in report.remarks[0]
    assert len(report.tables[0].table.rows) == 4 * len(wrist_memory.SHOWN)
    assert report.tables[1].table.rows[0] == ["fixed offset", *["100 ± 0"] * 3]
    assert len(report.pictures[0].figure.axes) == 3
