"""Calibration models on disk: a NumPy archive that executes nothing, with its card inside and beside it."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import read_arrays
from catenary.calibration.features import FeatureSet
from catenary.calibration.model import CalibrationModel, Card, JointGroup
from catenary.calibration.predictors import Constant, Linear, Network, Predictor, Quadratic
from catenary.calibration.valid_range import ValidRange
from catenary.errors import FileFormatError, InputError
from catenary.files import damage, write_atomically

FORMAT = "catenary.calibration.1"
SIMPLE: dict[str, type[Predictor]] = {each.kind: each for each in (Constant, Linear, Quadratic)}
NETWORK_ARRAYS = ("mean", "scale", "out_mean", "out_scale")
Arrays = dict[str, NDArray[Any]]


def card_path(path: Path) -> Path:
    """Return where the readable copy of a model's card is: beside the model."""
    return path.with_name(f"{path.stem}.card.json")


def save_model(model: CalibrationModel, card: Card, path: Path) -> None:
    """Write a model to `path` and a readable copy of its card beside it.

    Each of the two appears whole or not at all.

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
        "groups": [{"joints": group.joints, "predictor": _kind(group.predictor)} for group in model.groups],
    }
    text = json.dumps(card, indent=2, ensure_ascii=False) + "\n"
    arrays: Arrays = {
        "structure": np.array(json.dumps(structure)),
        "card": np.array(text),
        "offset": model.offset,
    }
    for i, group in enumerate(model.groups):
        arrays |= {f"{i}.columns": group.columns, f"{i}.watched": group.watched}
        arrays |= {f"{i}.range.{key}": values for key, values in vars(group.valid_range).items()}
        arrays |= {f"{i}.predictor.{key}": values for key, values in _to_arrays(group.predictor).items()}
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    write_atomically(path, buffer.getvalue())
    write_atomically(card_path(path), text.encode())


def load_model(path: Path) -> tuple[CalibrationModel, Card]:
    """Read a model and its card.

    Raises:
        FileFormatError: No such file, not a model, of another version, or damaged.
    """
    remedy = "`catenary fit` makes a model again, `catenary calibrate` those of its project"
    try:
        arrays = read_arrays(path)
    except FileFormatError as error:
        if not path.is_file():
            raise
        raise FileFormatError(damage(path, str(error).removeprefix(f"{path}: "), remedy)) from error
    if "structure" not in arrays or "card" not in arrays:
        raise FileFormatError(
            f"{path}: is no calibration model (it holds {', '.join(arrays) or 'nothing'}); "
            "models are written by catenary fit"
        )
    try:
        for key, values in arrays.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise ValueError(f"{key} holds NaN or infinity")
        structure = json.loads(str(arrays["structure"]))
        if structure["format"] != FORMAT:
            raise FileFormatError(f"{path}: model format {structure['format']!r}, expected {FORMAT!r}")
        features = FeatureSet(
            tuple(structure["signals"]),
            tuple(structure["signal_units"]),
            int(structure["history"]),
            tuple((str(name), float(width)) for name, width in structure["play"]),
            # an older file has none, and its play states follow every position
            tuple((str(name), float(step)) for name, step in structure.get("steps", ())),
            structure.get("period"),
        )
        rate = structure.get("rate_hz")  # not known, or the file is older than the field
        if rate is not None and not 0.0 < rate < float("inf"):
            raise ValueError(f"rate of {rate} Hz")
        groups = tuple(_group(arrays, i, entry) for i, entry in enumerate(structure["groups"]))
        model = CalibrationModel(
            kind=structure["kind"],
            preset=structure["preset"],
            joint_names=tuple(structure["joint_names"]),
            joint_units=tuple(structure["joint_units"]),
            features=features,
            target=structure["target"],
            offset=arrays["offset"],
            groups=groups,
            rate_hz=rate,
        )
        card = json.loads(str(arrays["card"]))
        if not isinstance(card, dict):
            raise ValueError("the card is no table")
        return model, card
    except FileFormatError:
        raise
    except (KeyError, TypeError, ValueError, IndexError, InputError) as error:
        raise FileFormatError(damage(path, f"is no calibration model: {error!r}", remedy)) from error


def _group(arrays: Arrays, i: int, entry: dict[str, Any]) -> JointGroup:
    prefix = f"{i}.predictor."
    return JointGroup(
        joints=tuple(int(j) for j in entry["joints"]),
        columns=arrays[f"{i}.columns"],
        predictor=_from_arrays(
            entry["predictor"], {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}
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
