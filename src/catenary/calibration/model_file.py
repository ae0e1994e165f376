"""Calibration models on disk: a NumPy archive that executes nothing, with its card inside and beside it."""

import json
from pathlib import Path
from typing import Annotated, Any, Literal
from zipfile import is_zipfile

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from catenary.archives import content_in_words, read_arrays
from catenary.calibration.features import FeatureSet
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel, Card, JointGroup, Target
from catenary.calibration.predictors import Constant, Linear, Network, Predictor, Quadratic
from catenary.calibration.valid_range import ValidRange
from catenary.cards import card_of, write_with_card
from catenary.config import Recorded, parse_settings
from catenary.documents import cut, json_table, shortened
from catenary.errors import CatenaryError, FileFormatError
from catenary.files import damage
from catenary.recording.mend import MENDS
from catenary.robots.plausible import FARTHEST, check_different, check_names, check_within

FORMAT = "catenary.calibration.3"
SIMPLE: dict[str, type[Predictor]] = {each.kind: each for each in (Constant, Linear, Quadratic)}
INTERVAL_ARRAYS = ("inside", "outside")
NETWORK_ARRAYS = ("mean", "scale", "out_mean", "out_scale")
Arrays = dict[str, NDArray[Any]]
Many = Field(max_length=10_000)  # of anything that a model has several of
Widths = Annotated[tuple[tuple[str, Annotated[float, Field(gt=0.0)]], ...], Many]
MendKey = Annotated[str, Field(pattern=MENDS)]


class GroupStructure(Recorded):
    """Joints that share a predictor."""

    joints: Annotated[tuple[Annotated[int, Field(ge=0, lt=10_000)], ...], Many]
    predictor: str


class ModelStructure(Recorded):
    """All of a model but its arrays; what an older file does not have has a default."""

    kind: str
    preset: str | None
    joint_names: Annotated[tuple[str, ...], Many]
    joint_units: Annotated[tuple[Literal["rad", "m"], ...], Many]
    signals: Annotated[tuple[str, ...], Many]
    signal_units: Annotated[tuple[str, ...], Many]
    history: Annotated[int, Field(ge=0, le=1_000)]
    play: Widths
    steps: Widths = ()  # none: play states follow every position
    period: Annotated[float, Field(gt=0.0)] | None = None
    target: Target
    rate_hz: Annotated[float, Field(gt=0.0)] | None = None
    groups: Annotated[tuple[GroupStructure, ...], Many]
    priors: Annotated[tuple[str | None, ...], Many] = ()  # none: no joint's fit began at one
    coverage: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None  # of the intervals, where there are some
    mends: dict[MendKey, tuple[str, ...]] = Field(default_factory=dict, max_length=50)


def save_model(model: CalibrationModel, card: Card, path: Path) -> None:
    """Write a model to `path` and a readable copy of its card beside it, as `write_with_card` does.

    Raises:
        FileFormatError: The file cannot be written.
    """
    structure = {
        "format": FORMAT,
        "kind": model.kind,
        "preset": model.preset,
        "joint_names": model.joint_names,
        "joint_units": model.joint_units,
        "signals": model.features.signals,
        "signal_units": model.features.units,
        "history": model.features.history,
        "play": model.features.play,
        "steps": model.features.steps,
        "period": model.features.period,
        "target": model.target,
        "rate_hz": model.rate_hz,
        "priors": model.priors,
        "coverage": None if model.intervals is None else model.intervals.level,
        "mends": dict(model.mends),
        "groups": [{"joints": group.joints, "predictor": _kind(group.predictor)} for group in model.groups],
    }
    structure_text = np.array(json.dumps(structure))
    arrays: Arrays = {"structure": structure_text, "offset": model.offset, "largest": model.largest}
    if model.limits is not None:
        arrays["limits"] = model.limits
    if model.intervals is not None:
        arrays |= {f"interval.{key}": getattr(model.intervals, key) for key in INTERVAL_ARRAYS}
    for i, group in enumerate(model.groups):
        arrays |= {f"{i}.columns": group.columns, f"{i}.watched": group.watched}
        arrays |= {f"{i}.range.{key}": values for key, values in vars(group.valid_range).items()}
        arrays |= {f"{i}.predictor.{key}": values for key, values in _to_arrays(group.predictor).items()}
    write_with_card(path, arrays, card)


def load_model(path: Path) -> tuple[CalibrationModel, Card]:
    """Read a model and its card.

    Raises:
        FileFormatError: No such file, not a model, of another version, damaged, or changed since it was written.
    """
    remedy = "`catenary fit` makes a model again, `catenary calibrate` those of its project"
    try:
        arrays = read_arrays(path)
    except FileFormatError as error:
        if not path.is_file():
            raise
        if path.suffix not in ("", ".npz") and not is_zipfile(path):
            raise FileFormatError(
                f"{path}: is no calibration model; expected one (.npz) that catenary fit wrote"
            ) from error
        raise FileFormatError(damage(path, str(error).removeprefix(f"{path}: "), remedy)) from error
    if not {"structure", "card"} <= set(arrays) or "combination" in arrays:
        raise FileFormatError(
            f"{path}: is no calibration model ({content_in_words(arrays)}); models are written by catenary fit"
        )
    try:
        for key, values in arrays.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise ValueError(f"{key} holds NaN or infinity")
        found = json_table(str(arrays["structure"]), "structure")
        if found.get("format") != FORMAT:
            raise FileFormatError(
                f"{path}: model format {shortened(found.get('format'))}, expected {FORMAT!r}"
            )
        structure = parse_settings(found, ModelStructure, "structure")
        check_names("joint", structure.joint_names)
        check_different("joint", structure.joint_names)
        for key in ("offset", "largest"):
            check_within(key, arrays[key], FARTHEST, "rad or m")
        features = FeatureSet(
            structure.signals,
            structure.signal_units,
            structure.history,
            structure.play,
            structure.steps,
            structure.period,
        )
        model = CalibrationModel(
            kind=structure.kind,
            preset=structure.preset,
            joint_names=structure.joint_names,
            joint_units=structure.joint_units,
            features=features,
            target=structure.target,
            offset=arrays["offset"],
            largest=arrays["largest"],
            groups=tuple(_group(arrays, i, entry) for i, entry in enumerate(structure.groups)),
            rate_hz=structure.rate_hz,
            intervals=_intervals(arrays, structure.coverage),
            priors=structure.priors,
            limits=arrays.get("limits"),
            mends=structure.mends,
        )
        return model, card_of(arrays, path, remedy)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        if str(error).startswith(f"{path}: "):
            raise
        why = str(error) if isinstance(error, CatenaryError) else repr(error)
        raise FileFormatError(damage(path, f"is no calibration model: {cut(why)}", remedy)) from error


def _intervals(arrays: Arrays, level: float | None) -> Intervals | None:
    if level is None:
        return None
    widths = {key: arrays[f"interval.{key}"] for key in INTERVAL_ARRAYS}
    for key, values in widths.items():
        check_within(f"interval {key}", values, FARTHEST, "rad or m")
    return Intervals(level, **widths)


def _group(arrays: Arrays, i: int, entry: GroupStructure) -> JointGroup:
    prefix = f"{i}.predictor."
    return JointGroup(
        joints=entry.joints,
        columns=arrays[f"{i}.columns"],
        predictor=_from_arrays(
            entry.predictor, {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}
        ),
        valid_range=ValidRange(
            **{key: arrays[f"{i}.range.{key}"] for key in ValidRange.__dataclass_fields__}
        ),
        watched=arrays[f"{i}.watched"],
    )


def _kind(predictor: Predictor) -> str:
    if isinstance(predictor, Constant | Linear | Quadratic | Network):
        return predictor.kind
    raise TypeError(f"no file format for {type(predictor).__name__}")


def _to_arrays(predictor: Predictor) -> Arrays:
    if not isinstance(predictor, Network):
        return dict(vars(predictor))
    arrays: Arrays = {key: getattr(predictor, key) for key in NETWORK_ARRAYS}
    arrays["activation"] = np.array(predictor.activation)
    for k, (W, b) in enumerate(zip(predictor.weights, predictor.biases, strict=True)):
        arrays |= {f"weights{k}": W, f"bias{k}": b}
    if predictor.skip is not None:
        arrays |= {f"skip_{key}": values for key, values in vars(predictor.skip).items()}
    return arrays


def _from_arrays(kind: str, arrays: Arrays) -> Predictor:
    if kind in SIMPLE:
        return SIMPLE[kind](**arrays)
    if kind != Network.kind:
        raise ValueError(f"unknown predictor {kind!r}")
    layers = range(sum(key.startswith("weights") for key in arrays))
    activation: Any = str(arrays["activation"])
    return Network(
        weights=tuple(arrays[f"weights{k}"] for k in layers),
        biases=tuple(arrays[f"bias{k}"] for k in layers),
        activation=activation,
        skip=Linear(arrays["skip_weights"], arrays["skip_bias"]) if "skip_weights" in arrays else None,
        **{key: arrays[key] for key in NETWORK_ARRAYS},
    )
