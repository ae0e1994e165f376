"""What can be chosen in a fit, of the model and of the run."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date as day
from typing import Literal, get_args

from catenary.calibration.friction_states import FoundFriction
from catenary.calibration.intervals import check_level
from catenary.calibration.model import Target
from catenary.errors import InputError

Kind = Literal["auto", "offset", "linear", "polynomial", "hysteretic", "neural"]
Preset = Literal["paper", "best"]
KINDS: tuple[str, ...] = get_args(Kind)
PRESETS: tuple[str, ...] = get_args(Preset)
# half-widths of the play states, as shares of each joint's range of motion: from a cable's slack to its stretch
PLAY_SHARES = (0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
MEMORY_RIDGE = 10.0  # for regressions on features with memory, which resemble each other
FOLDS = 5
COVERAGE = 0.9
TAKE_RIDGE = ("auto", "linear", "polynomial", "hysteretic")
TAKE_FRICTION = ("auto", "hysteretic", "neural")


@dataclass(frozen=True)
class FitOptions:
    """Options of a fit; a fixed offset is one of the error, whatever the target."""

    kind: Kind = "auto"  # auto is chosen for every joint from the others (kind_choice.py)
    preset: Preset | None = None  # of kind neural; "best" when None
    # signals or groups of signals, for all joints or per joint; positions and, if recorded, torques when None
    inputs: Sequence[str] | Mapping[str, Sequence[str]] | None = None
    # half-widths of play states, as shares of each joint's range; None is none, but for `best` without torque, which
    # tells too on which side of its slack a cable lies: play and friction states then add what can be over-fitted
    play: tuple[float, ...] | None = None
    target: Target = "error"
    ridge: float | None = None  # None means 0, or 10 for regressions on features with memory
    seed: int = 0
    coupled: tuple[str, ...] | None = None  # joints that friction couples; found when None (friction_fit.py)
    friction: FoundFriction | None = None  # what was found

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f'model "{self.kind}": expected one of {", ".join(KINDS)}')
        if self.preset is not None and (self.preset not in PRESETS or self.kind != "neural"):
            raise InputError(
                f'preset "{self.preset}" of model "{self.kind}": only neural has presets, {" and ".join(PRESETS)}'
            )
        if self.target not in get_args(Target):
            raise InputError(f'target "{self.target}": expected one of {", ".join(get_args(Target))}')
        if any(not 0.0 < share < 1.0 for share in self.play or ()):
            raise InputError(f"play: expected shares of the range of motion between 0 and 1, got {self.play}")
        if self.ridge is not None and not 0.0 <= self.ridge < math.inf:
            raise InputError(f"ridge: expected a number of zero or more, got {self.ridge}")
        if self.ridge is not None and self.kind not in TAKE_RIDGE:
            raise InputError(f"ridge {self.ridge} of model {self.kind}: only {', '.join(TAKE_RIDGE[1:])} take one")
        if self.coupled and not self.takes_friction():
            raise InputError(f"coupled joints of model {self.kind}: only hysteretic and best take any")
        if self.kind == "auto" and self.target != "error":
            raise InputError(f'target "{self.target}": models of it are not chosen; give a kind in place of auto')

    def of_kind(self, kind: Kind, preset: Preset | None = None) -> "FitOptions":
        """Return the options of a kind of model, without those that it does not take."""
        ridge = self.ridge if kind in TAKE_RIDGE else None
        coupled = self.coupled if kind in TAKE_FRICTION and preset != "paper" else ()
        return replace(self, kind=kind, preset=preset, ridge=ridge, coupled=coupled)

    def play_shares(self, signals: Sequence[str]) -> tuple[float, ...]:
        """Return shares of each joint's range of motion that the play states take beside the given signals."""
        if self.play is not None:
            return self.play
        torque = any(name.startswith("tau:") for name in signals)
        return PLAY_SHARES if self.kind == "hysteretic" or (self.network == "best" and not torque) else ()

    def takes_friction(self, signals: Iterable[str] = ()) -> bool:
        """Return whether the model may take friction states of coupled joints beside the given signals."""
        told = self.kind == "neural" and self.coupled is None and any(name.startswith("tau:") for name in signals)
        return self.kind in TAKE_FRICTION and self.network != "paper" and self.target == "error" and not told

    @property
    def network(self) -> Preset | None:
        """The preset that a network is trained by; None for other kinds."""
        return (self.preset or "best") if self.kind == "neural" else None

    @property
    def ridge_used(self) -> float | None:
        """Weight on the squared coefficients of a regression; None for other kinds."""
        if self.kind not in ("linear", "polynomial", "hysteretic") or self.ridge is not None:
            return self.ridge
        return MEMORY_RIDGE if self.kind == "hysteretic" or self.play else 0.0


@dataclass(frozen=True)
class FitRun:
    """Options of a fit that do not belong to the model: which rows it sees, and how it is tested."""

    robot: str | None = None
    max_error: tuple[float, ...] | None = None  # per joint, deg and mm; rows beyond are left out
    held_out: float | None = None  # share at the end of each recording
    folds: int = FOLDS  # of the cross-validation; 0 for none
    accept: tuple[str, ...] = ()  # findings about the data to go on with, by name
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


def require_folds(options: FitOptions, run: FitRun) -> None:
    """Refuse to choose a model by errors on folds that are not run."""
    if options.kind == "auto" and not run.folds:
        raise InputError("model auto: is chosen by its errors on folds, which folds 0 leaves out; give a kind")
