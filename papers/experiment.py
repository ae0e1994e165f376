"""An experiment: cases that run apart from each other, what they show together, and what a paper claims of it.

A case is a function of this package and plain arguments; it gives plain data, the same wherever it runs. Everything
that takes time happens in cases; tables, pictures and verdicts are made of their results in a moment.
"""

import functools
import hashlib
import importlib
import inspect
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from catenary.simulation.cable_parameters import RAVEN2, RAVEN2_ECCENTRIC
from catenary.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Plain = Any  # None, bool, int, float, str, lists and mappings of these
Result = Mapping[str, Plain]
Paper = Literal["calibration", "gravity", "regressor", "tutorial", "plant", "beyond"]
# one session: what a paper saw of one robot once, and the simulated ones show by chance
Verdict = Literal["reproduced", "same direction", "not reproduced", "cannot be judged by one session", "not measured"]
BEYOND = "beyond"  # how the place of a claim begins that stands in no paper
Robot = int | None | str  # a drawn one by its seed, the nominal one, or the folder of a real one's recordings
NOMINAL = None  # the robot that the plant was fitted to; drawn robots have a seed


@dataclass(frozen=True)
class Case:
    """One run of a function: what it is called with decides its result."""

    function: str  # module and name
    revision: int
    text: str  # arguments as canonical JSON

    @property
    def arguments(self) -> dict[str, Plain]:
        """Return what the function is called with."""
        arguments: dict[str, Plain] = json.loads(self.text)
        return arguments

    @property
    def key(self) -> str:
        """Return the name of the result: 32 hexadecimal digits."""
        whole = json.dumps([self.function, self.revision, self.text, self.robots])
        return hashlib.sha256(whole.encode()).hexdigest()[:32]

    @property
    def robots(self) -> str:
        """Return the digest of the robots' data files on which the result may depend."""
        return robots_digest(frozenset(name for name in self.arguments.values() if isinstance(name, str)))

    @property
    def label(self) -> str:
        """Return the case in words, for progress and failures."""
        arguments = ", ".join(f"{name} {value}" for name, value in self.arguments.items())
        return f"{self.function.removeprefix('papers.')}({arguments})"

    def without(self, name: str) -> "Case":
        """Return the case without an argument."""
        rest = {each: value for each, value in self.arguments.items() if each != name}
        return replace(self, text=json.dumps(rest, sort_keys=True))

    def load(self) -> "Run":
        """Import the function."""
        module, _, name = self.function.rpartition(".")
        loaded = getattr(importlib.import_module(module), name)
        if not isinstance(loaded, Run):
            raise TypeError(f"{self.function}: expected a function marked with @run, got {type(loaded).__name__}")
        return loaded


class Run:
    """A function of plain arguments and plain results that cases call; made by `@run`."""

    def __init__(self, function: Callable[..., Result], revision: int) -> None:
        self.function, self.revision = function, revision
        self.needs_data = "data" in inspect.signature(function).parameters
        functools.update_wrapper(self, function)

    def __call__(self, *args: Plain, **arguments: Plain) -> Result:
        """Call the function."""
        return self.function(*args, **arguments)

    @property
    def name(self) -> str:
        """Return module and name of the function."""
        return f"{self.function.__module__}.{self.function.__qualname__}"

    def case(self, **arguments: Plain) -> Case:
        """Return a case of this function."""
        also = {"data": None} if self.needs_data else {}
        inspect.signature(self.function).bind(**arguments, **also)
        return Case(self.name, self.revision, json.dumps(arguments, sort_keys=True, allow_nan=False))


def run(*, revision: int) -> Callable[[Callable[..., Result]], Run]:
    """Mark a function as one that cases call; a change of the code that changes results raises its revision."""
    return lambda function: Run(function, revision)


# robots of the catalogue that experiments load by themselves; others count where a case names them
LOADED = (
    "dual_arm_19", "dvrk_mtm", "dvrk_mtm_motors", "dvrk_psm_motors", "panda", "raven2", "raven2_full",
    "raven2_full_right", "raven2_right", "two_link",
)  # fmt: skip
MARGIN = 0.05  # of the larger error
CLEARLY = f"by more than {100.0 * MARGIN:.0f} % and the spread over robots"
LATE = (
    f"One error is less than another where it is so {CLEARLY} of their ratio; a loss, of their difference. That margin "
    "was added after a first run, in which differences of the third digit had counted."
)
VARIANT = "arm"  # the argument that names a variant of the simulated robot, its data file; the default robot has none


@functools.cache
def robots_digest(named: frozenset[str] = frozenset()) -> str:
    """Return a digest of data files on which results depend: robots of LOADED, those named, and mechanics."""
    digest = hashlib.sha256(RAVEN2.encode())
    counted = {f"{name.removesuffix('.toml')}.toml" for name in (*LOADED, *named)}
    for room in ("robots", "simulation"):
        for entry in sorted((files("catenary") / room / "data").iterdir(), key=lambda each: each.name):
            mechanics = room == "simulation" and entry.name != RAVEN2_ECCENTRIC
            if entry.is_file() and (mechanics or entry.name in counted):
                digest.update(entry.name.encode() + b"\0" + entry.read_bytes() + b"\0")
    return digest.hexdigest()


@dataclass(frozen=True)
class Scope:
    """How much is run: which robots, how often networks are trained, and on what recordings."""

    robots: tuple[Robot, ...] = (NOMINAL, 1, 2, 3, 4, 5)
    networks: int = 2  # trainings of every network of the nominal robot, averaged as the paper does of its one
    quick: bool = False  # a minute at most, to see that it runs: no verdicts
    data: Path | None = None  # folder of recordings of real arms

    def networks_of(self, robot: Robot) -> list[int]:
        """Return the seeds with which networks of a robot are trained: of a drawn one, which tells the spread, one."""
        return list(range(1 if isinstance(robot, int) else self.networks))


class Outcomes:
    """Results of an experiment's cases, as far as they are there."""

    def __init__(self, results: Mapping[Case, Result]) -> None:
        """Take results; those of the robot's variant stand apart, as if it were the robot."""
        self._results = {case: result for case, result in results.items() if VARIANT not in case.arguments}
        of_variant = {case.without(VARIANT): result for case, result in results.items() if VARIANT in case.arguments}
        self.variant = Outcomes(of_variant) if of_variant else None

    def __len__(self) -> int:
        return len(self._results)

    @property
    def nominal(self) -> "Outcomes | None":
        """Return what the nominal robot alone left, and cases of no robot; None where no other robot has run."""
        alone = {case: result for case, result in self._results.items() if case.arguments.get("seed") is NOMINAL}
        return Outcomes(alone) if alone and len(alone) < len(self._results) else None

    @property
    def trainings(self) -> list[int]:
        """Return how often cases train a network, each number once; its errors are averaged.

        It is how many seeds the arguments `networks` and `trainings` hold, and one where `network` is a seed.
        """
        counts = set()
        for case in self._results:
            arguments = case.arguments
            counts |= {
                len(arguments[name]) for name in ("networks", "trainings") if isinstance(arguments.get(name), list)
            }
            counts |= {1} if type(arguments.get("network")) is int else set()
        return sorted(counts - {0})

    def of(self, function: Run, **arguments: Plain) -> list[Result]:
        """Return the results of a function's cases that have these arguments, in the cases' order."""
        return [result for _, result in self.items(function, **arguments)]

    def items(self, function: Run, **arguments: Plain) -> Iterator[tuple[dict[str, Plain], Result]]:
        """Yield arguments and results of a function's cases that have these arguments."""
        for case, result in self._results.items():
            stored = case.arguments
            if case.function == function.name and all(stored.get(k) == v for k, v in arguments.items()):
                yield stored, result


class Judgement(NamedTuple):
    """What was measured of a claim."""

    verdict: Verdict
    measured: str


Judge = Callable[[Outcomes], Judgement]


@dataclass(frozen=True)
class Claim:
    """One statement of a paper, and how it is decided, by a criterion written before the run, whether it holds here."""

    says: str
    place: str  # in the paper: section, table, figure; "beyond ..." where no paper claims it
    published: str  # the paper's own numbers
    criterion: str
    judge: Judge
    why: str = ""
    fitted: bool = False  # the simulated robot was fitted to this number, or to one that implies it


class TitledTable(NamedTuple):
    """A table of results."""

    title: str
    table: Table


@dataclass(frozen=True)
class Report:
    """What the cases show together."""

    tables: Sequence[TitledTable] = ()
    pictures: Mapping[str, "Figure"] = field(default_factory=dict)  # by caption, in the paper's form where there is one
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class Experiment:
    """A figure or a table of a paper, or one that goes beyond them."""

    name: str  # calibration-table-1
    place: str  # table I
    title: str
    doc: str | None  # of the module: its headline, then what `about` returns
    cases: Callable[[Scope], Sequence[Case]]
    report: Callable[[Outcomes], Report]
    _: KW_ONLY
    minutes: float  # of one processor, all of it
    claims: list[Claim] = field(default_factory=list)
    drawn: int = 5  # robots beside the nominal one
    simulated: bool = True  # False where all of it is measured on real arms
    needs_data: bool = False  # recordings of real arms, of which some cases are
    of: Paper | None = None  # the paper, where its name does not begin with it

    def claim(
        self, says: str, place: str, published: str, criterion: str, why: str = "", *, fitted: bool = False
    ) -> Callable[[Judge], Judge]:
        """Add a claim, in the claims' order, that the function below judges; see `Claim`."""

        def keep(judge: Judge) -> Judge:
            self.claims.append(Claim(says, place, published, criterion, judge, why, fitted))
            return judge

        return keep

    @property
    def paper(self) -> str:
        """Return the paper whose figure or table it is."""
        return self.of or self.name.partition("-")[0]

    @property
    def about(self) -> str:
        """Return conditions, and what was chosen where the paper is silent, or late, as the page tells them."""
        told = (self.doc or "").partition("\n")[2].strip()
        return f"{told}\n\n{LATE}" if any(CLEARLY in claim.criterion for claim in self.claims) else told
