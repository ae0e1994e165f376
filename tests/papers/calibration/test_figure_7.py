"""Figure 7: its report on made-up sections."""

import numpy as np

from papers.calibration.figure_7 import EXPERIMENT, HOURS, TRUTH
from papers.calibration.six_hours import MODELS, OFFSET
from papers.experiment import Outcomes, Scope


def test_sections_are_shown_by_joint_and_hour_with_their_errors() -> None:
    time = np.linspace(0.0, 10.0, 21)
    truth = np.column_stack([40.0 + time, 80.0 - time, 380.0 + time])
    section = {
        "time": time.tolist(),
        TRUTH: truth.tolist(),
        **{model: (truth - [0.1, 0.2, 0.3]).tolist() for model in (OFFSET, *MODELS)},
    }
    (case,) = EXPERIMENT.cases(Scope())
    shown = EXPERIMENT.report(Outcomes({case: {str(hour): section for hour in HOURS}}))
    assert [list(row)[1:] for row in shown.tables[0].table.rows] == [["0.100", "0.200", "0.300"] * 3] * 5
    assert [len(picture.figure.axes) for picture in shown.pictures] == [9, 9]
