import numpy as np
import pytest
from numpy.testing import assert_allclose

from papers.calibration import figure_3
from papers.calibration.published import BOX_SHARES, DURATIONS
from papers.experiment import Case, Outcomes, Result, Scope

SCOPE = Scope(robots=(None,))


def as_published(case: Case) -> Result:
    """Make up a path that is all that the paper says."""
    told = case.arguments
    direction, sparsities = told["direction"].split("-"), told["sparsities"]
    half = BOX_SHARES[len(direction)] / 2.0
    return {
        "seconds": DURATIONS.get(tuple(sparsities), 1000.0 * sum(1.0 / s for s in sparsities)),
        "low": [0.5 - half] * 3,
        "high": [0.5 + half] * 3,
        "even": [1.0 if joint in direction else 0.1 for joint in ("J1", "J2", "J3")],
        "reversals": [8, 2, 0],
        "volume": 0.192,
        "hole": min(sparsities),
        "corners": [[20.0, 55.0, 330.0], [60.0, 110.0, 420.0]],
    }


PUBLISHED = Outcomes({case: as_published(case) for case in figure_3.cases(SCOPE)})


def test_every_claim_holds_for_paths_that_are_what_the_paper_says() -> None:
    verdicts = {claim.says: claim.judge(PUBLISHED).verdict for claim in figure_3.CLAIMS}
    assert {says: verdict for says, verdict in verdicts.items() if verdict != "reproduced"} == {}


def test_recording_for_twice_as_long_is_no_calibration_of_the_papers_minutes() -> None:
    slow = Outcomes(
        {case: {**result, "seconds": 2.0 * result["seconds"]} for case, result in PUBLISHED._results.items()}
    )
    told = {claim.says: claim.judge(slow) for claim in figure_3.CLAIMS}
    found = told["Calibration takes 8 to 21 minutes, of which recording takes 4 to 17"]
    assert found.verdict == "not reproduced"
    assert found.measured.startswith("11.0 to 37.8 min, of which recording 7.0 to 33.8")


def test_nothing_is_judged_of_nothing() -> None:
    assert {claim.judge(Outcomes({})).verdict for claim in figure_3.CLAIMS} == {"not measured"}


def test_report_has_a_row_per_path_and_eight_panels() -> None:
    report = figure_3.report(PUBLISHED)
    assert len(report.tables[0].table.rows) == len(PUBLISHED)
    assert len(report.pictures[0].figure.axes) == 8


def test_a_single_directions_volume_is_the_cubes_and_its_hole_half_the_diagonal_between_sweeps() -> None:
    found = figure_3.path("J1", (1 / 2,))
    side = 3.0**-0.5
    assert_allclose(found["volume"], side**3, rtol=0.06)  # the path goes 5 % beyond the cube
    # four sweeps of a square of side / 2 leave its middle half a diagonal away; the grid misses it by up to 1/40
    assert_allclose(found["hole"], side * np.sqrt(0.5), atol=0.1)
    assert found["reversals"] == [8, 2, 0]


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_even_share_of_a_joint_that_dwells_on_a_part_of_its_range(share: float) -> None:
    rng = np.random.default_rng(0)
    positions = np.append(rng.uniform(0.0, share, 100_000), 1.0)
    assert_allclose(figure_3.even_share(positions), share, atol=0.02)  # one bin


def test_corners_are_where_a_broken_line_turns() -> None:
    line = np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(0.9, 0.0, 10)])
    rows = np.column_stack([line, line, 0.0 * line])
    assert figure_3.corners(rows).tolist() == [0, 10, 20]
    assert figure_3.reversals(line) == 1
