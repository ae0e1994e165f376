import numpy as np

from catenary.reports.project import TABLE_1
from papers.table1 import MODELS, RobotResult, gains, table


def _result(seed: int | None, factor: float) -> RobotResult:
    names = ["raw", "fixed offset", *MODELS, "neural, best, trained on random motion"]
    rmse = {name: factor * np.array([1.0, 2.0, 3.0]) for name in names}
    return RobotResult(seed, rmse, {})


def test_the_papers_numbers_stand_beside_the_simulated_ones() -> None:
    header, rows = table([_result(None, 1.0), _result(1, 1.0), _result(2, 2.0)])
    linear = next(row for row in rows if row[0] == "linear")
    assert linear[1:4] == ["1.000", "1.500 ± 0.707", f"{TABLE_1['linear'][0]:.3f}"]
    assert all(len(row) == len(header) for row in rows)
    assert "simulated" in header[0]


def test_every_model_of_the_paper_is_in_the_table() -> None:
    assert set(TABLE_1) <= {"raw", "fixed offset", *MODELS}


def test_gain_is_the_mean_ratio_over_robots() -> None:
    results = [_result(None, 1.0), _result(1, 1.0)]
    for result, factor in zip(results, (0.5, 1.5), strict=True):
        result.rmse["neural, preset best"] = factor * result.rmse["neural, preset paper"]
        result.rmse["neural, paper, trained on random motion"] = result.rmse["raw"]
    assert gains(results)["trained on zig-zag"] == [1.0, 1.0, 1.0]
