"""What is claimed, and how it is decided: of statements that hold or not, for each joint or robot, how many do."""

from collections.abc import Callable, Iterable

import numpy as np

from papers.experiment import Claim, Judgement, Outcomes, Verdict

NOT_MEASURED = Judgement("not measured", "-")
Judge = Callable[[Outcomes], Judgement]


class Missing(Exception):
    """No case that was asked for has run: a claim is not measured then, and a row is left out."""


class Claims(list[Claim]):
    """Claims of an experiment, in their order: `@CLAIMS(says, place, published, criterion)` stands above a judge."""

    def __call__(
        self, says: str, place: str, published: str, criterion: str, why: str = "", *, fitted: bool = False
    ) -> Callable[[Judge], Judge]:
        """Keep a claim that the function below judges; see `Claim`."""

        def keep(judge: Judge) -> Judge:
            self.append(Claim(says, place, published, criterion, judge, why, fitted))
            return judge

        return keep


def by_count(holds: Iterable[bool], measured: str) -> Judgement:
    """Judge a claim of several parts: reproduced where all hold, the same direction where more than half do."""
    parts = [bool(each) for each in holds]
    if not parts:
        return NOT_MEASURED
    verdict: Verdict = "not reproduced"
    if all(parts):
        verdict = "reproduced"
    elif sum(parts) > len(parts) / 2:
        verdict = "same direction"
    return Judgement(verdict, f"{measured} ({sum(parts)} of {len(parts)})" if len(parts) > 1 else measured)


def graded(reproduced: bool | np.bool_, direction: bool | np.bool_, measured: str) -> Judgement:
    """Judge a claim of one number: reproduced, or else of the paper's direction, or neither."""
    return Judgement("reproduced" if reproduced else "same direction" if direction else "not reproduced", measured)


def mean_and_spread(values: Iterable[float], digits: int = 3) -> str:
    """Return mean and standard deviation of a sample as text; the value alone where there is one."""
    sample = np.array([value for value in values if value is not None], dtype=float)
    if sample.size == 0:
        return "-"
    if sample.size == 1:
        return f"{sample[0]:.{digits}f}"
    return f"{sample.mean():.{digits}f} ± {sample.std(ddof=1):.{digits}f}"
