from math import gcd

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import random_sinusoids
from catenary.errors import InputError
from catenary.trajectories.sinusoids import FASTEST, SLOWEST
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER
from papers.beyond import paths
from papers.beyond.designed_motion import crossings, designed
from papers.calibration.figure_3 import reversals
from papers.experiment import Case, Outcomes, Result, Scope

SECONDS = 204.0
WIDTH = CALIBRATION_UPPER - CALIBRATION_LOWER


def sampled(path) -> np.ndarray:
    return path.sample(np.arange(0.0, path.duration, 0.05))[0]


def made_up(better: bool) -> Outcomes:
    """Errors that fall with the reversals, as they are expected to, or rise."""

    def result(case: Case) -> Result:
        told = case.arguments
        name = told["name"]
        many = name in (paths.RANDOM, paths.NARROW, paths.DESIGNED)
        count = (10.0 if many else 2.0 + paths.PATHS.index(name) / 10.0) * len(told["sparsities"])
        error = 1.0 / count if better else count
        found: dict[str, object] = {model: [error] * 3 for model in (*paths.MODELS, "raw", "fixed offset")}
        if name == paths.DESIGNED and better:
            found[paths.NETWORK] = [0.05] * 3
        return found | {"seconds": SECONDS, "reversals": [count] * 3, "range": [0.5] * 3}

    return Outcomes({case: result(case) for case in paths.cases(Scope(robots=(None, 1)))})


def test_what_is_expected_is_told_from_its_contrary() -> None:
    assert {claim.judge(made_up(True)).verdict for claim in paths.CLAIMS} == {"reproduced"}
    assert {claim.judge(made_up(False)).verdict for claim in paths.CLAIMS} == {"not reproduced"}
    assert {claim.judge(Outcomes({})).verdict for claim in paths.CLAIMS} == {"not measured"}


def test_report_has_tables_of_both_lengths_and_of_causes_and_says_which_path_is_best() -> None:
    report = paths.report(made_up(True))
    assert [len(one.table.rows) for one in report.tables] == [len(paths.PATHS)] * 2 + [10]
    assert len(report.pictures[0].figure.axes) == 6
    assert f'"{paths.DESIGNED}"' in report.remarks[0]


def test_a_designed_motion_crosses_the_range_as_often_as_told_and_as_random_motion_does() -> None:
    q = sampled(designed(SECONDS))
    counts = crossings(SECONDS, WIDTH, (SLOWEST + FASTEST) / 2.0)
    assert [reversals(column) + 1 for column in q.T] == counts
    assert all(gcd(a, b) == 1 for k, a in enumerate(counts) for b in counts[:k])
    drawn = sampled(random_sinusoids(np.random.default_rng(0), SECONDS))
    at_random = [reversals(column) + 1 for column in drawn.T]
    assert_allclose(counts, at_random, rtol=0.5)
    assert ((q >= CALIBRATION_LOWER) & (q <= CALIBRATION_UPPER)).all()


def test_a_designed_motion_meets_every_octant_of_the_box_for_its_even_share_of_time() -> None:
    upper_half = sampled(designed(SECONDS)) > (CALIBRATION_LOWER + CALIBRATION_UPPER) / 2.0
    share = np.bincount(upper_half @ [1, 2, 4], minlength=8) / len(upper_half)
    assert_allclose(share, 1.0 / 8.0, rtol=0.5)


@pytest.mark.parametrize("name", [paths.WIDE, paths.NARROW, paths.RANDOM, paths.DESIGNED])
def test_paths_of_one_length_take_as_long_and_cover_what_their_name_says(name: str) -> None:
    path, zigzag = (
        paths.trajectory(each, paths.SHORT, np.random.default_rng(0)) for each in (name, paths.ZIGZAG)
    )
    assert_allclose(path.duration, zigzag.duration)
    q, of_zigzag = sampled(path), np.ptp(sampled(zigzag), axis=0)
    expected = of_zigzag if name == paths.NARROW else WIDTH
    # corners are rounded by a per cent or two; random motion turns anywhere in a band of an eighth to a fifth
    assert_allclose(np.ptp(q, axis=0), expected, rtol=0.2 if name == paths.RANDOM else 0.03)


def test_a_motion_too_short_or_a_box_without_room_is_refused() -> None:
    with pytest.raises(InputError, match="no time"):
        designed(10.0)
    with pytest.raises(InputError, match="lower below upper"):
        designed(SECONDS, lower=CALIBRATION_UPPER, upper=CALIBRATION_LOWER)
