from pathlib import Path

import numpy as np
import pytest

from papers.gravity.tracking import Run, error_table, main, share_table

Ran = tuple[list[Run], Path]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    folder = tmp_path_factory.mktemp("tracking")
    # joint 1 swings most along y
    return main(folder, (None,), (20,), (), cycles=1, axes=("y",)), folder


def error(runs: list[Run], base: str, controller: str) -> float:
    return next(r.rms_error[0] for r in runs if (r.base, r.controller) == (base, controller))


@pytest.mark.slow
def test_sensed_gravity_takes_joint_one_nearer_to_its_reference_on_both_bases(ran: Ran) -> None:
    runs, _ = ran
    for base in ("20", "rocking"):
        assert error(runs, base, "dg") < error(runs, base, "pd")


@pytest.mark.slow
def test_page_and_data_hold_every_run(ran: Ran, written) -> None:
    runs, folder = ran
    results, page = written(folder, "gravity_tracking")
    assert len(results) == len(runs) == 3 + 4
    assert "figures 9 and 10" in page
    assert "cycles" in page


def run_of(seed: int | None, controller: str, error: float) -> Run:
    share = 1.0 if controller == "pd" else 0.5
    return Run(seed, "20", controller, "absolute", (error, 1.0, 1.0), (share,) * 3, (2.0,) * 3)


def test_tables_show_nominal_robot_spread_and_change() -> None:
    runs = [run_of(seed, "pd", 1.0) for seed in (None, 1, 2)]
    runs += [run_of(seed, "dg", error) for seed, error in ((None, 0.9), (1, 0.8), (2, 0.9))]
    header, row = error_table(runs, 0).header, error_table(runs, 0).rows[1]
    shown = dict(zip(header, row, strict=True))
    assert (shown["controller"], shown["nominal [deg]"]) == ("PD+DG", "0.9000")
    assert shown["against PD"] == f"{-100.0 * np.mean([0.1, 0.2, 0.1]):+.1f} ± 5.8 %"
    assert share_table(runs).rows[1][2] == "50.0 % of 2.000"
