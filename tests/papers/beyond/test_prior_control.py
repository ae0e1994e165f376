"""The control of the prior: errors with it over errors without, stage by stage."""

from papers.beyond.prior_control import WITH, WITHOUT, linear_curves, report
from papers.experiment import Outcomes


def test_the_table_has_the_geometric_mean_over_recordings_of_the_error_with_over_that_without() -> None:
    outcomes = Outcomes({
        linear_curves.case(recording=name): {
            WITH: {"all": {"rows": 100, "rmse": [factor, 1.0]}},
            WITHOUT: {"all": {"rows": 100, "rmse": [1.0, 2.0]}},
        }
        for name, factor in (("random_train", 4.0), ("insertion_train", 1.0))
    })  # fmt: skip
    ((_, first, second, everything, extremes),) = report(outcomes).tables[0].table.rows
    assert (first, second, everything, extremes) == ("2.00", "0.50", "1.00", "0.50 to 4.00")
