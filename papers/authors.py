"""Tables I to V and figures 5 to 9 of the calibration paper on the authors' own recordings: papers authors FOLDER.

The same functions, tables and criteria as on simulated robots; what the folder lacks, and what only a simulation can
tell, is left out. Results lie beside the simulated ones, in a folder named by the recordings' names and sizes.
"""

import hashlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from catenary.errors import InputError
from papers.calibration import authors, figure_5, homings, six_hours, table_1
from papers.calibration.figure_7 import sections
from papers.calibration.figure_8 import all_inputs
from papers.calibration.table_2 import more_epochs
from papers.catalog import experiment
from papers.experiment import Case, Experiment, Judge, Judgement, Outcomes, Run, Scope
from papers.kit import NOT_MEASURED, Missing
from papers.sweep import Planned

NAMES = (
    *(f"calibration-{name}" for name in ("table-1", "figure-5", "figure-6", "figure-7", "figure-8", "table-2")),
    *(f"calibration-{name}" for name in ("figure-9", "table-3", "table-4", "table-5")),
)
Arguments = dict[str, Any]


def digest(root: Path) -> str:
    """Return eight hexadecimal digits of the names and sizes of a folder's files."""
    lines = [f"{path.relative_to(root)} {path.stat().st_size}" for path in sorted(root.rglob("*.csv"))]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:8]


def planned(root: Path, *, quick: bool = False) -> list[Planned]:
    """Return the experiments that a folder of recordings holds something of; refused where no file is the authors'."""
    robot = str(root.resolve())
    authors.folders(robot)
    scope, plans = Scope((robot,), networks=1 if quick else Scope.networks), []
    for paper in map(experiment, NAMES):
        if cases := tuple(dict.fromkeys(_there(paper, scope, robot))):
            claims = [replace(one, judge=_as_far_as_measured(one.judge), why="", fitted=False) for one in paper.claims]
            plans.append(Planned(replace(paper, simulated=False, claims=claims), scope, cases))
    return plans


def _there(paper: Experiment, scope: Scope, robot: str) -> Iterator[Case]:
    for case in paper.cases(scope):
        function, arguments = case.load(), case.arguments
        if function is sections:  # figure 7, of the nominal robot alone
            arguments["seed"] = robot
        if arguments.get("seed") != robot or function not in _FITTING:
            continue
        with suppress(InputError):  # of what it asks the folder holds no session
            if _FITTING[function](arguments):
                yield function.case(**arguments)


# each narrows a case's arguments to what the folder holds, and says whether that is something
def _of_hours(arguments: Arguments) -> bool:
    recorded = set(authors.hours(arguments["seed"], arguments.get("condition", "unloaded")).of())
    for name in ("sets", "ours"):
        if name in arguments:
            arguments[name] = [one for one in arguments[name] if set(six_hours.denominators(one)) <= recorded]
    training_sets = arguments["sets"] if "sets" in arguments else [arguments["training_set"]]
    return bool(training_sets) and all(set(six_hours.denominators(one)) <= recorded for one in training_sets)


def _of_homings(arguments: Arguments) -> bool:
    session = authors.homed(arguments["seed"], arguments["seen"])
    first, second = (set(session.of(homings=k)) for k in (0, arguments["seen"]))
    arguments["combinations"] = [
        parts
        for parts in arguments["combinations"]
        if all({round(1 / s) for s in part} <= have for part, have in zip(parts, (first, second), strict=True))
    ]
    arguments["homings"] = len(session.homings) - 1
    return bool(arguments["combinations"])


def _of_direction(arguments: Arguments) -> bool:
    return bool(authors.tested(arguments["seed"], arguments["direction"]))


def _of_sparsities(arguments: Arguments) -> bool:
    session, _ = authors.tested(arguments["seed"], "J2-J3")
    return {int(part[2:]) for part in figure_5.parts(arguments["name"])} <= set(session.of())


# what a case asks of the folder, by its function
_FITTING: dict[Run, Callable[[Arguments], bool]] = {
    **dict.fromkeys((six_hours.six_hours, more_epochs, all_inputs, sections), _of_hours),
    homings.homing_errors: _of_homings, table_1.direction_errors: _of_direction,
    figure_5.sparsity_errors: _of_sparsities,
}  # fmt: skip


def _as_far_as_measured(judge: Judge) -> Judge:
    def judged(o: Outcomes) -> Judgement:
        try:
            return judge(o)
        except (Missing, LookupError, ValueError):  # parts that the folder lacks
            return NOT_MEASURED

    return judged
