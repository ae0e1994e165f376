"""Options of a fit: of the model, and of the run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date as day
from typing import Any, get_args

from catenary.calibration.features import FrictionStates
from catenary.calibration.intervals import check_level
from catenary.calibration.model import Target
from catenary.calibration.model_kinds import LEARNED, MODEL_KINDS, OWN, ModelKind, kind_of
from catenary.errors import InputError

# half-widths of play states, of each joint's range of motion: from a cable's slack to its stretch
PLAY_SHARES = (0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
MEMORY_RIDGE = 10.0  # for regressions on features with memory, which resemble each other
FOLDS = 5
COVERAGE = 0.9


@dataclass(frozen=True)
class FoundFriction:
    """Properties of joints that friction couples, found in recordings."""

    states: FrictionStates
    gain: float  # share of the coupled joints' error on blocks of time that friction states take from play states'


@dataclass(frozen=True)
class FoundCables:
    """Properties of cables found in recordings (cable_search.py)."""

    paths: tuple[tuple[str, str, str, float], ...] = ()  # as those of a FeatureSet
    slacks: tuple[tuple[str, float], ...] = ()  # position or path, half-width of its slack [rad|m]


@dataclass(frozen=True)
class FitOptions:
    """Options of a fit; a fixed offset is one of the error, whatever the target."""

    kind: str = LEARNED
    preset: str | None = None
    # signals or groups of signals, for all joints or per joint; positions and, if recorded, torques when None
    inputs: Sequence[str] | Mapping[str, Sequence[str]] | None = None
    # half-widths of play states, as shares of each joint's range; those of the kind when None
    play: tuple[float, ...] | None = None
    target: Target = "error"
    ridge: float | None = None  # None means 0, or 10 with play states
    seed: int = 0
    coupled: tuple[str, ...] | None = None  # joints that friction couples; found when None (cable_search.py)
    friction: FoundFriction | None = None  # what was found
    cables: FoundCables | None = None  # what was found
    # of model "own": has scikit-learn's fit, predict and get_params, or is a function of features
    estimator: Any = None

    def __post_init__(self) -> None:
        taking_ridge = [name for name, kind in MODEL_KINDS.items() if "ridge" in kind.takes]
        kind_of(self.kind, self.preset)  # refuses unknown ones
        if self.target not in get_args(Target):
            raise InputError(f'target "{self.target}": expected one of {", ".join(get_args(Target))}')
        if any(not 0.0 < share < 1.0 for share in self.play or ()):
            raise InputError(f"play: expected shares of the range of motion between 0 and 1, got {self.play}")
        if self.ridge is not None and not 0.0 <= self.ridge < math.inf:
            raise InputError(f"ridge: expected a number of zero or more, got {self.ridge}")
        if self.ridge is not None and self.kind not in taking_ridge:
            raise InputError(f"ridge {self.ridge} of model {self.kind}: only {', '.join(taking_ridge)} take one")
        if self.coupled and not self.takes_friction:
            raise InputError(f"coupled joints of model {self.kind}: only {LEARNED} supports them, with target error")
        if (self.estimator is None) is (self.kind == OWN):
            raise InputError(f"model {self.kind}: an estimator or function makes model {OWN}, and that needs one")

    @property
    def record(self) -> ModelKind:
        """The record of its kind."""
        return kind_of(self.kind, self.preset)

    def of_kind(self, kind: str, preset: str | None = None) -> "FitOptions":
        """Return the options of a kind of model, without those that it does not take."""
        record = kind_of(kind, preset)
        ridge = self.ridge if "ridge" in record.takes else None
        coupled = self.coupled if record.play_shares else ()
        estimator = self.estimator if kind == OWN else None
        return replace(self, kind=kind, preset=preset, ridge=ridge, coupled=coupled, estimator=estimator)

    @property
    def is_function(self) -> bool:
        """Whether it is a function of one's own, which no rows are fitted to; it takes no play states unasked."""
        return self.kind == OWN and not hasattr(self.estimator, "fit")

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares of each joint's range of motion that the play states take."""
        if self.play is not None:
            return self.play
        return () if self.is_function else self.record.play_shares

    @property
    def takes_friction(self) -> bool:
        """Whether the model may take what is found of cables: friction states of coupled joints, paths and slack."""
        return self.target == "error" and bool(self.record.play_shares and self.shares)

    @property
    def ridge_used(self) -> float | None:
        """Weight on the squared coefficients of a regression; None for other kinds."""
        if "ridge" not in self.record.takes or self.ridge is not None:
            return self.ridge
        return MEMORY_RIDGE if self.play else 0.0


@dataclass(frozen=True)
class FitRun:
    """Options of a fit that do not belong to the model: which rows it sees, and how it is tested."""

    robot: str | None = None
    max_error: tuple[float, ...] | None = None  # per joint, deg and mm; rows beyond are left out
    held_out: float | None = None  # share at the end of each recording
    folds: int = FOLDS  # of the cross-validation; 0 for none
    accept: tuple[str, ...] = ()  # names of findings about the data to continue despite
    coverage: float = COVERAGE  # share of errors that the model's intervals are to hold
    instrument: str | None = None  # for the card: which one the arm held
    tool: str | None = None  # the kind of tool
    date: str | None = None  # of recordings that have none (ISO 8601)

    def __post_init__(self) -> None:
        if self.held_out is not None and not 0.0 < self.held_out < 1.0:
            raise InputError(f"held-out share: expected a number between 0 and 1, got {self.held_out}")
        if self.folds < 0 or self.folds == 1:
            raise InputError(f"folds: expected 2 or more, or 0 for no cross-validation, got {self.folds}")
        check_level(self.coverage)
        if self.date is not None and not _is_date(self.date):
            raise InputError(f"date: expected a day such as 2026-05-14, got {self.date!r}")


def _is_date(text: str) -> bool:
    try:
        return day.fromisoformat(text).isoformat() == text
    except ValueError:
        return False
