"""The kinds of calibration models, one record each: what a fit, a card, the help and the contract tests ask of one."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from catenary.errors import InputError

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.arrays import Floats
    from catenary.calibration.predictors import AnyPredictor

_UNBOUNDED = 1e6  # of ranges


@dataclass(frozen=True)
class ModelKind:
    """A kind of model.

    How far beyond the training data a model may go is a share of their range. A regression's leverage tells where it
    knows less than the fixed offset (extrapolation.py), so that it may go far; of others half a range is known, and a
    range along principal axes: farther, drawn arms err half as much, but intervals that were to hold 90 % hold 63 %. So
    the learned model goes on to twice as far, and its intervals are the fixed offset's there.

    Args:
        name, words: Name as typed, and description in the help.
        fitted_by: `module:function` of this room, called with features (N, F), wanted outputs (N, m) and what it
            `takes`; it returns a predictor (predictors.py), which model files hold as it is.
        takes: Further arguments of that function, of those that fit_rows.fit_model gives.
        settings: The name, in that module, of settings that the function takes and the card tells.
        play_shares: Half-widths of play states that it takes unasked, of each joint's range; with friction states.
        of_error: It is fitted to the joint error, whatever the target.
        beyond: How far beyond the box of the training data it may go.
        along_axes: The same along principal axes.
        fades_at: How far out it has become the fixed offset, smoothly: 1 at the edge of the valid range, 2 twice as far
            from its middle, with intervals as at the edge; 0 if it leaps there.
        in_c: It can be written as C.
    """

    name: str
    words: str
    fitted_by: str
    takes: tuple[str, ...] = ()
    preset: str | None = None
    settings: str | None = None
    play_shares: tuple[float, ...] = ()
    of_error: bool = False
    beyond: float = 1.5
    along_axes: float = _UNBOUNDED
    fades_at: float = 0.0
    in_c: bool = True

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"

    def fit(self, X: "Floats", Y: "Floats", **arguments: Any) -> "AnyPredictor":
        """Fit outputs Y (N, m) to features X (N, F); of the arguments given, the kind gets what it takes."""
        function = getattr(self._module, self.fitted_by.partition(":")[2])
        settings = {} if self.settings is None else {"settings": self.own_settings}
        fitted: AnyPredictor = function(X, Y, **settings, **{name: arguments[name] for name in self.takes})
        return fitted

    @property
    def own_settings(self) -> Any:
        """Its settings, a dataclass; None without."""
        return None if self.settings is None else getattr(self._module, self.settings)

    @property
    def _module(self) -> Any:
        return import_module(f"catenary.calibration.{self.fitted_by.partition(':')[0]}")


_PLAY_SHARES = tuple(0.0006 * 1.5**k for k in range(15))
_KINDS = (
    ModelKind("offset", "the mean error", "predictors:fit_offset", of_error=True),
    ModelKind("linear", "a linear function", "predictors:fit_linear", ("ridge",)),
    ModelKind("polynomial", "one of second order", "predictors:fit_polynomial", ("ridge",)),
    ModelKind(
        "neural",
        "the network of Peng et al.",
        "neural:fit_neural",
        ("seed", "progress"),
        preset="paper",
        settings="PAPER",
        beyond=0.5,
        along_axes=1.0,
    ),
    ModelKind(
        "learned",
        "a ridge regression on positions, loads and play states, tuned on blocks of time",
        "learned:fit_learned",
        ("features", "columns", "joints", "block", "recording", "penalties"),
        play_shares=_PLAY_SHARES,
        beyond=0.5,
        along_axes=1.0,
        fades_at=2.0,
    ),
    ModelKind(
        "own",
        "your own estimator or function, as MODULE:NAME",
        "own_model:fit_own",
        ("estimator", "seed"),
        play_shares=_PLAY_SHARES,
        beyond=0.5,
        along_axes=1.0,
        fades_at=1.0,
        in_c=False,
    ),
)
MODEL_KINDS: Mapping[str, ModelKind] = {kind.name: kind for kind in _KINDS}
LEARNED = "learned"  # the default kind
OWN = "own"
RETIRED = ("auto", "hysteretic")  # and preset best of neural: models of files, which are no longer fitted


def kind_of(name: str, preset: str | None = None) -> ModelKind:
    """Return the record of a kind, by its name or a preset's; InputError for none, or one no longer fitted."""
    if name not in MODEL_KINDS:
        why = "; it is no longer fitted" if name in RETIRED else ""
        raise InputError(f'model "{name}": expected one of {", ".join(MODEL_KINDS)}{why}')
    kind = MODEL_KINDS[name]
    if preset not in (None, kind.preset):
        presets = [f"{kind.preset} of {kind.name}" for kind in _KINDS if kind.preset is not None]
        raise InputError(f'preset "{preset}" of model "{name}": there is {", ".join(presets)} alone')
    return kind
