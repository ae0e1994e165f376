"""What experiments are written with: cases by a grid, samples over robots, tables that skip what has not run, verdicts.

A claim is decided by statements that hold or not, for each joint or robot: of several it is told how many do.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import product
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.tables import Table
from papers.experiment import Case, Judgement, Outcomes, Plain, Run, TitledTable

JOINTS = ("J1", "J2", "J3")
UNITS = ("deg", "deg", "mm")
IN_UNITS = ("J1 [deg]", "J2 [deg]", "J3 [mm]")
NOT_MEASURED = Judgement("not measured", "-")


class Missing(Exception):
    """No case that was asked for has run: a claim is not measured then, and a row is left out."""


class Sample(np.ndarray):
    """Numbers by robot, (robots,) or (robots, 3): f"{x:.2f}" tells mean and spread, of the latter joint by joint."""

    def __format__(self, spec: str) -> str:
        """Return "mean ± spread" in a format such as ".2f", the median before it in one such as ".2m".

        One number is told as Python does.
        """
        digits = int(spec[1:-1]) if spec else 3
        if self.ndim == 2:
            return ", ".join(f"{joint} {column:{spec}}" for joint, column in zip(JOINTS, self.T, strict=True))
        if self.ndim == 0:
            return format(float(self), spec)
        text = mean_and_spread(self, digits)
        return f"{median(self):.{digits}f} (mean {text})" if spec.endswith("m") else text


def mean_and_spread(values: Iterable[float], digits: int = 3) -> str:
    """Return mean and standard deviation of a sample as text; the value alone where there is one."""
    sample = np.array([value for value in values if value is not None], dtype=float)
    if sample.size == 0:
        return "-"
    if sample.size == 1:
        return f"{sample[0]:.{digits}f}"
    return f"{sample.mean():.{digits}f} ± {sample.std(ddof=1):.{digits}f}"


def graded(reproduced: bool | np.bool_, direction: bool | np.bool_, measured: str) -> Judgement:
    """Judge a claim of one number: reproduced, or else of the paper's direction, or neither."""
    return Judgement("reproduced" if reproduced else "same direction" if direction else "not reproduced", measured)


def by_count(holds: Iterable[bool], measured: str) -> Judgement:
    """Judge a claim of several parts: reproduced where all hold, the same direction where more than half do."""
    parts = [bool(each) for each in holds]
    if not parts:
        return NOT_MEASURED
    counted = f"{measured} ({sum(parts)} of {len(parts)})" if len(parts) > 1 else measured
    return graded(all(parts), sum(parts) > len(parts) / 2, counted)


def median(values: Floats) -> Any:
    """Return the median over robots of numbers whose first axis is the robot: one robot of six decides no claim."""
    return np.median(np.asarray(values), axis=0)


def by_robot(values: Any) -> Floats:
    """Return numbers whose first axis is the robot, as a sample."""
    return np.asarray(values, dtype=float).view(Sample)


def sample(outcomes: Outcomes, run: Run, /, *path: str | int, **where: Plain) -> Floats:
    """Return what a function's cases have at a path of their results, robot by robot; some may lack its first step."""
    values: list[Any] = [one for one in outcomes.of(run, **where) if not path or path[0] in one]
    for part in path:
        values = [one[part] for one in values]
    if not values:
        raise Missing(f"{run.name} {where}")
    return by_robot(values)


def grid(run: Run, axes: Mapping[str, Iterable[Plain]], /, **fixed: Plain) -> list[Case]:
    """Return a case for every combination along axes, the last one fastest.

    Of what is fixed, a function is asked for what a robot has: `seed` is among the axes then.
    """
    combinations = [dict(zip(axes, each, strict=True)) for each in product(*axes.values())]
    return [
        run.case(**at, **{name: value(at["seed"]) if callable(value) else value for name, value in fixed.items()})
        for at in combinations
    ]


def rounded(values: Iterable[float], digits: int = 6) -> list[float]:
    """Return numbers as plain data."""
    return [round(float(value), digits) for value in values]


def cells(values: Floats, digits: int = 3) -> list[str]:
    """Return mean and spread over robots of every column of numbers (robots, columns)."""
    return [mean_and_spread(column, digits) for column in values.T]


def rows(row: Callable[..., Sequence[Any]], *axes: Iterable[Any]) -> list[list[str]]:
    """Return a row for every combination that has run; a sample in it is told to three digits."""
    made = []
    for each in product(*axes):
        with suppress(Missing):
            made.append([f"{cell}" for cell in row(*each)])
    return made


def table(title: str, header: str | Sequence[str], content: Sequence[Sequence[str]]) -> TitledTable:
    """Return a table; its header may be a line, columns by bars."""
    return TitledTable(title, Table(header.split(" | ") if isinstance(header, str) else header, content))


def joint_tables(
    title: str, header: str | Sequence[str], content: Callable[[int], Sequence[Sequence[str]]]
) -> list[TitledTable]:
    """Return a table for every joint of those that have rows; the title holds {} for the joint."""
    return filled(table(title.format(joint), header, content(j)) for j, joint in enumerate(IN_UNITS))


def filled(tables: Iterable[TitledTable]) -> list[TitledTable]:
    """Return those tables that have rows."""
    return [each for each in tables if each.table.rows]


def as_text(values: Mapping[Any, Any], form: str = ".3f", unit: str = "", *, between: str = ", ") -> str:
    """Return named samples as text: "a 1.0 ± 0.1, b ..."."""
    return between.join(f"{name} {value:{form}}{unit}" for name, value in values.items())


def unless_missing(tell: Callable[[Outcomes], str]) -> Callable[[Outcomes], list[str]]:
    """Let a function that tells something of outcomes return it in a list, empty where cases have not run."""
    return lambda outcomes: [cell for (cell,) in rows(lambda: [tell(outcomes)])]
