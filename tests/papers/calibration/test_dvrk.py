import numpy as np
import pytest

from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_rows import choose_inputs
from papers.calibration import dvrk
from papers.calibration.peers.rows import rows_of_log
from papers.experiment import Outcomes, Scope
from recordings import recording as made


def entry(*rmse: float, outside: float = 0.0) -> dict[str, object]:
    return {"rmse": list(rmse), "outside": outside}


@pytest.fixture
def outcomes() -> Outcomes:
    results: dict = {}
    for case in dvrk.cases(Scope(networks=2)):
        told = case.arguments
        value = float(told["seed"] + 1)
        if "peer" in told:
            results[case] = {told["peer"]: entry(*[value] * 6)}
        else:
            results[case] = {name: entry(*[value] * 6, outside=0.25) for name in dvrk.variants(told["kind"])}
            if told["kind"] == "linear":
                results[case] |= {"raw": entry(*[8.0] * 6), "fixed offset": entry(*[4.0] * 6)}
    return Outcomes(results)


def test_every_model_has_a_row_with_the_spread_over_trainings(outcomes: Outcomes) -> None:
    report = dvrk.report(outcomes)
    assert len(report.tables) == 4
    rows = {row[0]: row[1:] for row in report.tables[0].table.rows}
    assert list(rows)[:2] == ["raw", "fixed offset"]
    assert rows["linear, play"] == ["1.000"] * 6 + ["25.0 %"]
    assert rows["neural, best"][0] == "1.500 ± 0.707"
    assert rows[dvrk.RECURRENT] == ["1.500 ± 0.707"] * 6 + ["-"]
    assert len(rows) == 2 + 3 * 3 + 2 + 3


def test_the_picture_is_in_shares_of_the_fixed_offset(outcomes: Outcomes) -> None:
    (picture,) = dvrk.report(outcomes).pictures
    heights = {round(bar.get_height(), 6) for bar in picture.figure.axes[0].patches}
    assert heights == {25.0, 37.5}


def test_limits_of_the_cameras_failures_are_in_the_logs_units() -> None:
    limit = dvrk._limit("sampled_train")
    assert limit is not None
    np.testing.assert_allclose(limit[[0, 2]], [np.deg2rad(2.0), 5e-3])
    assert dvrk._limit("random_train") is None


def test_quick_cases_are_few() -> None:
    assert len(dvrk.cases(Scope(quick=True, networks=1))) == 4


@pytest.mark.parametrize("recording", dvrk.RECORDINGS)
def test_models_of_ours_and_peers_learn_from_the_same_rows_and_are_tested_on_the_same(recording: str) -> None:
    rng = np.random.default_rng(3)
    ok = rng.random(501) > 0.1
    units = ("rad", "rad", "m", "rad", "rad", "rad")
    log = made(rng, 501, units, error=lambda q: np.deg2rad(2.0) * rng.normal(size=q.shape), ok=ok)
    limit = dvrk._limit(recording)
    for options in dvrk.KINDS.values():
        inputs = choose_inputs([log], options, held_out=dvrk.HELD_OUT)
        ours = calibration_data([log], inputs.features, max_error=limit).split_by_time(dvrk.HELD_OUT)
        for rows, peers in zip(ours, dvrk.parted(rows_of_log(log, ("q",)), limit), strict=True):
            assert log.time is not None
            np.testing.assert_array_equal(rows.time, log.time[peers])
