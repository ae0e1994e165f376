"""Models of one's own: whatever has scikit-learn's fit, predict and get_params, or a function of features.

An estimator sees standardised features and outputs, so that its settings mean the same for every joint and unit; one is
fitted for each joint, or one for all where it takes several outputs. A function gets features as they are, (N, F), and
returns outputs (N, m) [rad|m]. Both see rows whose features are finite, in any order, in a loop one at a time.

A file holds an estimator in skops's format, or as its own `save(path)` writes it; of a function its name alone. Nothing
of it is imported or executed unless the caller names its class.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from io import BytesIO
from pathlib import Path
from pkgutil import resolve_name
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from catenary.archives import MAX_UNPACKED_BYTES, UNREADABLE
from catenary.arrays import Floats
from catenary.bounded_parsers import reading
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_kinds import OWN
from catenary.calibration.predictors import OwnFunction
from catenary.calibration.valid_range import standardisation
from catenary.errors import FileFormatError, InputError, imported

_BY_SKOPS, _BY_ITSELF = b"skops:", b"own:"
Function = Callable[[Floats], ArrayLike]
Named = str | type | Function  # a class or function, or "module:name" of it


def chosen(model: Any) -> tuple[str, Any]:
    """Return the kind of a model, and the estimator or function of one's own; text is a kind or "module:name"."""
    if isinstance(model, str) and ":" not in model:
        return model, None
    estimator = named(model) if isinstance(model, str) else model
    return OWN, estimator() if isinstance(estimator, type) else estimator


def named(name: Named) -> Any:
    """Return the object called "module:name"; classes and functions unchanged."""
    if not isinstance(name, str):
        return name
    try:
        return resolve_name(name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f'model "{name}": expected module:name of a class or function that Python can import: {error}; '
            "PYTHONPATH=FOLDER finds modules of a folder"
        ) from error


def name_of(thing: Any) -> str:
    """Return "module:name" of a function or class, or of an object's class."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}:{named.__qualname__}"


def fit_own(X: Floats, Y: Floats, *, estimator: Any, seed: int) -> OwnFunction:
    """Fit clones of an estimator to give Y (N, m) from features X (N, F); a function is taken as it is.

    Random states that are None become the seed.
    """
    from sklearn.utils import get_tags

    (_, inputs), outputs = X.shape, Y.shape[1]
    if not hasattr(estimator, "fit") and callable(estimator):
        plain = np.zeros(inputs), np.ones(inputs), np.zeros(outputs), np.ones(outputs)
        return OwnFunction(name_of(estimator), *plain, (estimator,))
    (mean, scale), (out_mean, out_scale) = standardisation(X), standardisation(Y)
    Z, normalised = (X - mean) / scale, (Y - out_mean) / out_scale
    out_scale = np.where(np.ptp(normalised, axis=0) > 1e-9, out_scale, 0.0)  # a constant gets no ripple
    is_tagged = outputs > 1 and hasattr(estimator, "__sklearn_tags__")
    targets = [normalised] if is_tagged and get_tags(estimator).target_tags.multi_output else normalised.T
    with threadpool_limits(limits=1):
        fitted = tuple(_fitted(estimator, seed, Z, np.ascontiguousarray(target)) for target in targets)
    return OwnFunction(name_of(estimator), mean, scale, out_mean, out_scale, fitted)


def _fitted(estimator: Any, seed: int, Z: Floats, y: Floats) -> Any:
    from sklearn.base import clone

    try:
        new = clone(estimator)
        unset = [name for name, value in new.get_params().items() if name.endswith("random_state") and value is None]
    except (TypeError, RuntimeError, AttributeError) as error:
        raise InputError(
            f"model {name_of(estimator)}: expected scikit-learn's fit, predict and get_params, and that clone() works, "
            f"or a function of features: {error}"
        ) from error
    if unset:
        new.set_params(**dict.fromkeys(unset, seed))
    new.fit(Z, y)
    return new


def packed(model: CalibrationModel) -> CalibrationModel:
    """Return a model whose own estimators are bytes, as a file holds them."""
    return _with_each(model, lambda own: replace(own, fitted=tuple(map(_packed, own.fitted))))


def with_estimators(model: CalibrationModel, own: Named | Sequence[Named] | None) -> CalibrationModel:
    """Return a model whose estimators are objects, of the classes or functions named; packed if None."""
    if own is None:
        return model
    several = own.split(",") if isinstance(own, str) else own if isinstance(own, Sequence) else [own]
    classes = [named(item) for item in several]

    def read(predictor: OwnFunction) -> OwnFunction:
        main = next((item for item in classes if name_of(item) == predictor.name), None)
        if main is None:
            raise InputError(f"model of {predictor.name}: is not loaded as {', '.join(map(name_of, classes))}")
        return replace(predictor, fitted=tuple(_unpacked(part.tobytes(), main, classes) for part in predictor.fitted))

    return _with_each(model, read)


def _with_each(model: CalibrationModel, change: Callable[[OwnFunction], OwnFunction]) -> CalibrationModel:
    groups = tuple(
        replace(group, predictor=change(group.predictor)) if isinstance(group.predictor, OwnFunction) else group
        for group in model.groups
    )
    return replace(model, groups=groups)


def _packed(thing: Any) -> NDArray[np.uint8]:
    if isinstance(thing, np.ndarray):
        return thing
    name, content = name_of(thing), b""
    if hasattr(thing, "save") and hasattr(thing, "load"):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "own"
            thing.save(path)
            content = _BY_ITSELF + path.read_bytes()
    elif hasattr(thing, "fit"):
        content = _BY_SKOPS + _skops().dumps(thing)
    elif name != f"{getattr(thing, '__module__', '')}:{getattr(thing, '__qualname__', '')}" or "<" in name:
        raise InputError(
            f"model of {name}: expected a function that its module names, which is stored by its name, or an object "
            "with save(path) and a class method load(path)"
        )
    return np.frombuffer(content, dtype=np.uint8)


def _unpacked(content: bytes, main: Any, classes: Sequence[Any]) -> Any:
    """Return an estimator from its bytes; types of packages other than those of the classes named are refused."""
    if not content:
        return main
    if content.startswith(_BY_ITSELF):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "own"
            path.write_bytes(content.removeprefix(_BY_ITSELF))
            return main.load(path)
    what, content, skops = f"estimator of {name_of(main)}", content.removeprefix(_BY_SKOPS), _skops()
    with reading(what, "skops writes it", (*UNREADABLE, ImportError)), ZipFile(BytesIO(content)) as archive:
        if sum(member.file_size for member in archive.infolist()) > max(MAX_UNPACKED_BYTES, len(content)):
            raise ValueError(f"would unpack to more than {MAX_UNPACKED_BYTES} bytes")
        unknown = list(map(str, skops.get_untrusted_types(data=content)))
    packages = {item.__module__.partition(".")[0] for item in classes}
    if others := [item for item in unknown if not _is_class_of(packages, item)]:
        raise InputError(f"model of {name_of(main)}: also holds {', '.join(others)}: name them too")
    with reading(what, "skops writes it", (*UNREADABLE, ImportError)):
        estimator = skops.loads(content, trusted=unknown)
    if type(estimator) is not main:
        raise FileFormatError(f"estimator: expected {name_of(main)}, got {name_of(estimator)}")
    return estimator


def _is_class_of(packages: set[str], name: str) -> bool:
    """Return True if a name is of a class that one of these packages, which the caller named, defines."""
    module, _, attribute = name.rpartition(".")
    kind = getattr(import_module(module), attribute, None) if module.partition(".")[0] in packages else None
    return isinstance(kind, type) and kind.__module__.partition(".")[0] in packages


def _skops() -> Any:
    return imported("skops.io", "files of estimators without `save` and `load` of their own need skops", "own")
