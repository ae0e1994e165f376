"""Calibration models on disk: a versioned NumPy archive that executes nothing, with its card inside and beside it.

A model is its own schema: the archive holds its plain data as JSON (`structure`), in which arrays stand by their names.
"""

import json
import logging
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any
from zipfile import is_zipfile

import numpy as np
from numpy.typing import NDArray

from catenary.archives import content_in_words, read_arrays
from catenary.bounded_parsers import cut, json_table, shortened
from catenary.calibration.feature_terms import Terms
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_kinds import RETIRED, kind_of
from catenary.calibration.own_model import Named, packed, with_estimators
from catenary.calibration.predictors import Expansion, Leverage, linear
from catenary.cards import card_of, stored, write_with_card
from catenary.config import parse_settings
from catenary.errors import CatenaryError, FileFormatError, InputError
from catenary.files import damage
from catenary.robots.plausibility import MAX_LENGTH_M, check_different, check_names, check_within

_log = logging.getLogger(__name__)
_FORMAT, _BEFORE = "catenary.calibration.6", "catenary.calibration.5"
_FIELD_NAMES = tuple(field.name for field in fields(CalibrationModel))


def save_model(model: CalibrationModel, card: Card, path: Path) -> None:
    """Write a model, and a readable copy of its card beside it.

    Args:
        model, card, path: The model, its card, and the file (.npz).
    """
    whole, arrays = packed(model), dict[str, NDArray[Any]]()
    structure = {"format": _FORMAT} | stored({name: getattr(whole, name) for name in _FIELD_NAMES}, arrays)
    write_with_card(path, {"structure": np.array(json.dumps(structure)), **arrays}, card)


def load_model(path: Path, own: Named | Sequence[Named] | None = None) -> tuple[CalibrationModel, Card]:
    """Read a model and its card.

    Args:
        path: The file (.npz).
        own: Class or function of a model of kind "own" (own_model.py).
    """
    remedy = "`catenary fit` makes a model again, `catenary calibrate` those of its project"
    try:
        arrays = read_arrays(path)
    except FileFormatError as error:
        if not path.is_file():
            raise
        if path.suffix not in ("", ".npz") and not is_zipfile(path):
            raise FileFormatError(
                f"{path}: is not a calibration model; expected one (.npz) that catenary fit wrote"
            ) from error
        raise FileFormatError(damage(path, str(error).removeprefix(f"{path}: "), remedy)) from error
    if not {"structure", "card"} <= set(arrays) or "combination" in arrays:
        raise FileFormatError(
            f"{path}: is not a calibration model ({content_in_words(arrays)}); models are written by catenary fit"
        )
    try:
        for key, values in arrays.items():
            if values.dtype.kind == "f" and not np.isfinite(values).all():
                raise ValueError(f"{key} holds NaN or infinity")
        structure = json_table(str(arrays["structure"]), "structure")
        if (version := structure.pop("format", None)) not in (_FORMAT, _BEFORE):
            raise FileFormatError(
                f"{path}: model format {shortened(version)}, expected {_FORMAT!r}: another version wrote it; {remedy}"
            )
        renewed = arrays if version == _FORMAT else _renew(structure, arrays)
        model = parse_settings(structure, CalibrationModel, "structure", renewed)
        if model.kind in RETIRED or model.preset == "best":
            name = f"{model.kind} {model.preset or ''}".strip()
            _log.warning("%s: models of kind %s are no longer fitted and less accurate: fit again", path, name)
        else:
            kind_of(model.kind, model.preset)  # refuses unknown ones
        check_names("joint", model.joint_names)
        check_different("joint", model.joint_names)
        check_within("offset", model.offset, MAX_LENGTH_M, "rad or m")
        check_within("largest", model.largest, MAX_LENGTH_M, "rad or m")
        if model.intervals is not None:
            check_within("intervals", model.intervals.outside, MAX_LENGTH_M, "rad or m")
        card = card_of(arrays, path, remedy)
    except (KeyError, ValueError, IndexError, OverflowError) as error:
        if str(error).startswith(f"{path}: "):
            raise
        why = str(error) if isinstance(error, CatenaryError) else repr(error)
        raise FileFormatError(
            damage(path, f"is not a calibration model, or of another version: {cut(why)}", remedy)
        ) from error
    return with_estimators(model, own), card


def _renew(structure: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Bring the structure of a file of the format before up to date; return its arrays, with those that it now has."""
    arrays, (features, intervals) = dict(arrays), (structure.get("features") or {}, structure.get("intervals") or {})
    intervals.pop("margin", None)
    skipping = [g for g in structure["groups"] if g["predictor"].pop("skip", None)]
    if features.pop("midlines", None) or skipping:
        raise InputError("it uses torque midlines or a network's linear part, no longer supported: fit again")
    for k, group in enumerate(structure["groups"]):
        own: dict[str, Any] = group["predictor"]
        old: dict[str, Any] = {key: arrays.get(v, v) if isinstance(v, str) else v for key, v in own.items()}
        match old.pop("kind"):
            case "constant":
                new = linear(np.zeros((len(arrays[group["columns"]]), len(old["value"]))), old["value"])
            case "linear":
                new = linear(**old)
            case "quadratic":
                terms = Terms.plain(old["mean"], old["scale"], np.column_stack(np.triu_indices(len(old["mean"]))))
                new = Expansion(terms, np.vstack([old["linear"], old["quadratic"]]), old["bias"])
            case "expansion":
                names = {"constants": "sketch_bias"}
                own["leverage"] = {n.name: own.pop(names.get(n.name, n.name)) for n in fields(Leverage)}
                continue
            case _:
                continue
        group["predictor"] = stored(new, arrays, f"groups.{k}.predictor")
    return arrays
