"""Whether a model's intervals hold: the share of errors within them, and how wide they are, joint by joint."""

from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.evaluate import Evaluation
from catenary.reports.error_tables import in_units
from catenary.reports.page import Block, Heading, Table, Text


def coverage_title(level: float) -> str:
    """Return what the table shows, in words."""
    return f"Errors within the model's intervals, which are to hold {_percent(level)}"


def coverage_table(evaluation: Evaluation) -> Table:
    """Return width and coverage of the intervals per joint, and whether they hold; for a model that has some."""
    rows = [
        [joint.name, joint.unit, f"{joint.half_width:.3f}", _percent(joint.coverage), verdict]
        for joint, verdict in zip(evaluation.joints, coverage_verdicts(evaluation), strict=True)
    ]
    unit = in_units(joint.unit for joint in evaluation.joints)
    return Table(["joint", "unit", f"half-width {unit}", "held [% of rows]", "verdict"], rows)


def coverage_blocks(evaluation: Evaluation) -> list[Block]:
    """Return what a page says of a model's intervals."""
    heading = Heading("Intervals")
    if evaluation.level is None:
        text = "The model has no intervals: they are estimated from a cross-validation of enough rows."
        return [heading, Text(text)]
    return [
        heading,
        coverage_table(evaluation),
        Text(
            f"Each corrected position comes with an interval that is to hold {_percent(evaluation.level)} of errors "
            "on later data of the same kind: median half-width, share of rows whose error lies within it. Outside the "
            "model's valid range intervals are wider. Too narrow: so small a share is not laid to chance, counting "
            "blocks of time, whose rows depend on each other."
        ),
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"
