"""The kinds of calibration models, one record each: what a fit, a card, the help and the contract tests ask of one."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from catenary.errors import InputError

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.arrays import Floats
    from catenary.calibration.predictors import AnyPredictor


@dataclass(frozen=True)
class ModelKind:
    """A kind of model, or one of its presets.

    How far beyond the training data a model may go is a share of their range. Zig-zag data leave nearly half of the
    shoulder's range out; half a range beyond, models without memory still correct most of the error there. Most
    principal axes are narrow, as joints move together in training: of simulated arms and a real dVRK, models that do
    not grow as powers err up to a range beyond as they do within. A polynomial doubles its error there; one with memory
    has hundreds of terms, and its error grows fast.

    Args:
        name: As it is typed.
        words: What it is, in the words of the help.
        fitted_by: `module:function` of this room, called with features (N, F), wanted outputs (N, m) and what it
            `takes`; it returns a predictor (predictors.py), which model files hold as it is.
        takes: Further arguments of that function, of `ridge`, `seed`, `late` and `progress`.
        preset: Its name where the kind has several; the first record of a kind is its default.
        settings: The name, in that module, of settings that the function takes and the card tells.
        memory: When it takes play and friction states unasked; beside torques they can be over-fitted.
        midlines: It takes midlines of torques and currents.
        of_error: It is fitted to the joint error, whatever the target.
        as_recorded: It is fitted to rows as they are, each recording's zero within.
        tried: `auto` tries it.
        beyond: How far beyond the box of the training data it may go.
        beyond_with_memory: The same of a model that takes play or friction states.
        is_power: It grows as powers do: along principal axes too it goes no farther than beyond the box.
    """

    name: str
    words: str
    fitted_by: str
    takes: tuple[str, ...] = ()
    preset: str | None = None
    settings: str | None = None
    memory: Literal["asked", "without torque", "always"] = "asked"
    midlines: bool = False
    of_error: bool = False
    as_recorded: bool = False
    tried: bool = False
    beyond: float = 0.5
    beyond_with_memory: float = 0.5
    is_power: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"

    def fit(self, X: "Floats", Y: "Floats", **given: Any) -> "AnyPredictor":
        """Fit outputs Y (N, m) to features X (N, F); of the arguments given, the kind gets what it takes."""
        function = getattr(self._module, self.fitted_by.partition(":")[2])
        settings = {} if self.settings is None else {"settings": self.own_settings}
        fitted: AnyPredictor = function(X, Y, **settings, **{name: given[name] for name in self.takes})
        return fitted

    @property
    def own_settings(self) -> Any:
        """Its settings, a dataclass; None without."""
        return None if self.settings is None else getattr(self._module, self.settings)

    @property
    def _module(self) -> Any:
        return import_module(f"catenary.calibration.{self.fitted_by.partition(':')[0]}")


_NETWORK = ("neural:fit_neural", ("seed", "late", "progress"))
_KINDS = (  # those that are tried, the simplest first
    ModelKind("offset", "the mean error", "predictors:fit_offset", of_error=True, as_recorded=True, tried=True),
    ModelKind("linear", "a linear function", "predictors:fit_linear", ("ridge",), tried=True),
    ModelKind(
        "polynomial",
        "one of second order",
        "predictors:fit_polynomial",
        ("ridge",),
        beyond_with_memory=0.1,
        is_power=True,
    ),
    ModelKind(
        "hysteretic",
        "smooth, with memory",
        "predictors:fit_smooth",
        ("ridge", "seed"),
        memory="always",
        midlines=True,
        tried=True,
    ),
    ModelKind("neural", "a network", *_NETWORK, preset="best", settings="BEST", memory="without torque", tried=True),
    ModelKind("neural", "the network of Peng et al.", *_NETWORK, preset="paper", settings="PAPER", as_recorded=True),
)
MODEL_KINDS: Mapping[str, tuple[ModelKind, ...]] = {  # by name, its presets where it has several
    kind.name: tuple(each for each in _KINDS if each.name == kind.name) for kind in _KINDS
}
AUTO = "auto"  # chosen for every joint from those that are tried (kind_choice.py)
TRIED = tuple(kind.name for kind in _KINDS if kind.tried)


def kind_of(name: str, preset: str | None = None) -> ModelKind:
    """Return the record of a kind and its preset; of its default where that is None."""
    if name not in (AUTO, *MODEL_KINDS):
        raise InputError(f'model "{name}": expected one of {", ".join((AUTO, *MODEL_KINDS))}')
    for kind in MODEL_KINDS.get(name, ()):
        if preset in (None, kind.preset):
            return kind
    several = [each for each in _KINDS if each.preset is not None]
    named = " and ".join(each.preset or "" for each in several)
    raise InputError(f'preset "{preset}" of model "{name}": only {several[0].name} has presets, {named}')
