import numpy as np
import pytest

from catenary import CablePlant
from catenary.spatial import LEVEL
from papers.experiment import Case, Outcomes, Result, Scope
from papers.gravity import adaptive, figure_9, figure_10
from papers.gravity.raven_base import ASIDE, rocking_base, turned_base
from papers.gravity.tracking import ROCKING, ROCKING_ASIDE, follow_sinusoids, gravity_source


def followed(errors: dict[str, float]) -> Result:
    return {
        f"{name} absolute": {
            "controller": name,
            "damping": "absolute",
            "rms_error": [error, error, error],
            "pd_share": [0.5, 0.5, 0.5],
            "tip_mm": [1.0, 1.0, 1.0, 2.0],
            "true_tip_mm": 9.0,
        }
        for name, error in errors.items()
    }


def at(base: str) -> Case:
    return follow_sinusoids.case(seed=None, base=base, way="increments", controllers=adaptive.LEARNT)


BETTER = {
    "pd": 1.0,
    "sg": 0.9,
    "dg": 0.8,
    "adaptive": 0.7,
    "adaptive-dg": 0.6,
    "recursive": 0.9,
    "recursive-dg": 0.8,
    "dg-attitude": 0.85,
    "adaptive-attitude": 0.65,
    "recursive-attitude": 0.85,
}
WORSE = {**BETTER, "dg": 0.5, "adaptive": 0.55, "adaptive-attitude": 0.58, "recursive-dg": 1.0}


@pytest.mark.parametrize(
    ("errors", "verdicts"),
    [
        (BETTER, ["reproduced"] * 4),
        (WORSE, ["not reproduced", "not reproduced", "not reproduced", "reproduced"]),  # three of six steps
        ({"pd": 1.0}, ["not measured"] * 4),
    ],
)
def test_adaptive_terms_are_judged_against_the_model(errors: dict[str, float], verdicts: list[str]) -> None:
    outcomes = Outcomes({at(base): followed(errors) for base in ("20", ROCKING, ROCKING_ASIDE)})
    assert [claim.judge(outcomes).verdict for claim in adaptive.CLAIMS] == verdicts


def test_what_figures_9_and_10_run_is_not_run_again() -> None:
    robots = Scope(robots=(None, 1, 2))
    known = {*figure_9.cases(robots), *figure_10.cases(robots)}
    here = adaptive.cases(robots)
    assert len(known & set(here)) == 6
    assert len(here) == 6 + 6 + 6 + 2


def test_table_has_a_row_for_each_controller_and_base() -> None:
    outcomes = Outcomes({at(base): followed(BETTER) for base in ("20", ROCKING)})
    (table,) = (one.table for one in adaptive.report(outcomes).tables)
    assert len(table.rows) == 14
    assert table.rows[4][:3] == ["20 deg", "PD+adaptive", "0.600"]


def test_spread_stands_beside_the_mean_and_a_remark_says_what_other_damping_does() -> None:
    results = {}
    for seed, more in ((None, 0.0), (1, 0.1)):
        case = follow_sinusoids.case(seed=seed, base="20", way="increments", controllers=adaptive.LEARNT)
        results[case] = followed({name: error + more for name, error in BETTER.items()})
    relative = follow_sinusoids.case(seed=None, base="20", way="joints", controllers=adaptive.RELATIVE)
    results[relative] = {
        f"{name} relative": one | {"damping": "relative"}
        for name, one in (("pd", followed({"pd": 0.25})["pd absolute"]),
                          ("adaptive-dg", followed({"adaptive-dg": 1.75})["adaptive-dg absolute"]))
    }  # fmt: skip
    outcomes = Outcomes(results)
    unmodelled = adaptive.CLAIMS[1].judge(outcomes).measured
    assert unmodelled.startswith("J1 0.650 ± 0.071 against 0.850 ± 0.071 deg")
    (remark,) = adaptive.report(outcomes).remarks
    assert remark.endswith("at 20 deg by 1.75 deg, PD alone by 0.25 deg.")


def test_an_orientation_sensor_knows_the_tilt_and_no_acceleration() -> None:
    base = rocking_base(lever=ASIDE)
    time = 0.13
    truth = base.sample(np.array([time]))
    told = {
        name: gravity_source(name, CablePlant(seed=None, base=base)) for name in ("dg-attitude", "dg-ideal")
    }
    np.testing.assert_allclose(told["dg-attitude"].read(time).gravity, truth.gravity[0])
    felt = truth.gravity[0] - truth.motion[0, 2]
    assert np.linalg.norm(felt - truth.gravity[0]) > 0.3  # 0.32 m from the axis
    np.testing.assert_allclose(told["dg-ideal"].read(time).gravity, felt, atol=1e-9)


def test_without_a_sensor_a_tilted_base_is_taken_for_level() -> None:
    source = gravity_source("adaptive", CablePlant(seed=None, base=turned_base(20.0)))
    assert source is not None
    np.testing.assert_array_equal(source.read(1.0).gravity, LEVEL)


@pytest.mark.slow
def test_masses_that_are_learnt_take_the_load_off_the_pd_term() -> None:
    wanted = (("pd", "absolute"), ("adaptive-dg", "absolute"))
    found = follow_sinusoids(None, "20", "increments", wanted, cycles=1, axes=["y"])
    plain, learnt = (found[f"{name} absolute"]["rms_error"][0] for name in ("pd", "adaptive-dg"))
    assert learnt < plain
