"""Figure 6: its report on made-up hours."""

from typing import Any

from papers.calibration import published
from papers.calibration.figure_6 import EXPERIMENT, SHOWN, TRAINED
from papers.calibration.recordings import NETWORK
from papers.calibration.sessions import HOURS
from papers.calibration.six_hours import LONG, OFFSET, cases_of, six_hours
from papers.experiment import Outcomes, Scope


def outcomes(
    loss: dict[str, float],
    joint_1: float = 1.0,
    *,
    short: tuple[float, float] = (1.3, 1.1),
    polynomial: float = 2.0,
) -> Outcomes:
    """Make up errors that start at the paper's and grow by a share of the paper's growth.

    Args:
        loss: The share, by condition.
        joint_1: The same of joint 1 alone, which the loss is multiplied by.
        short: Errors of training sets up to 800 s over those of longer ones, of regressions and of networks.
        polynomial: On joints 2 and 3, of which the paper has no numbers, its errors over the linear model's.
    """

    def hours(condition: str, model: str, name: str) -> list[dict[str, Any]]:
        known = published.SIX_HOURS[condition]
        first, last = (list(each) for each in known.get(model, known["linear"]))
        if model == "polynomial":
            j1 = published.SIX_HOURS_POLYNOMIAL_J1[condition]
            first, last = (
                [end, *(polynomial * value for value in each[1:])]
                for end, each in zip(j1, (first, last), strict=True)
            )
        by = 1.0 if name in LONG or model == OFFSET else short[model == NETWORK]
        told = []
        for hour in HOURS[condition]:
            share = loss[condition] * hour / 5.0
            errors = [a + share * (b - a) for a, b in zip(first, last, strict=True)]
            errors[0] = first[0] + joint_1 * (errors[0] - first[0])
            errors = [by * error for error in errors]
            told.append({"errors": errors, "guarded": errors, "tip": [1.0] * 4, "outside": 0.0})
        return told

    def result(arguments: dict[str, Any]) -> dict[str, Any]:
        return {
            model: {name: hours(arguments["condition"], model, name) for name in arguments["sets"]}
            for model in SHOWN
        }

    cases = [
        case for case in cases_of(Scope(robots=(None, 1), networks=1)) if case.function == six_hours.name
    ]
    return Outcomes({case: result(case.arguments) for case in cases})


def test_the_report_shows_every_condition_and_model_beside_the_paper() -> None:
    shown = EXPERIMENT.report(outcomes(dict.fromkeys(HOURS, 1.0)))
    rows = {row[0]: row for row in shown.tables[0].table.rows}
    assert len(rows) == len(HOURS) * len(SHOWN)
    first = rows["loaded, network"]
    assert first[1].startswith(first[2])
    assert first[3].startswith(first[4])
    assert len(shown.pictures[0].figure.axes) == 9


def test_every_hour_of_long_and_short_training_is_told_and_idle_hours_are_two() -> None:
    shown = EXPERIMENT.report(outcomes(dict.fromkeys(HOURS, 1.0)))
    for j, one in enumerate(shown.tables[-3:]):
        rows = {(row[0], row[1]): row[2:] for row in one.table.rows}
        assert len(rows) == len(HOURS) * len(SHOWN) * len(TRAINED)
        assert rows["idle, linear", "3 longest"][1:5] == ["-"] * 4
        first, last = published.SIX_HOURS["loaded"]["network"]
        told = [float(cell.partition(" ")[0]) for cell in rows["loaded, network", "3 longest"]]
        assert told == [round(first[j] + hour / 5.0 * (last[j] - first[j]), 3) for hour in range(6)]
        assert rows["loaded, network", "3 shortest"][0].startswith(f"{1.1 * first[j]:.3f}")
