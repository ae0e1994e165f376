"""A model's file against recordings of days: whether, and since when, it has drifted."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card_schema import check_card
from catenary.calibration.files import load_model
from catenary.calibration.model import Card
from catenary.calibration.upkeep.drift import BEYOND, DriftFound, find_drift
from catenary.errors import InputError
from catenary.workflows.fit import read_recording_of


def drift_of_model(model_path: Path, paths: Sequence[Path], *, factor: float = BEYOND) -> DriftFound:
    """Return a model's errors over recordings, in the order given; see `find_drift`.

    Raises:
        FileFormatError: The model or a recording is missing or damaged.
        InputError: As `find_drift`.
    """
    model, card = load_model(model_path)
    check_card(card, str(model_path))
    logs = [read_recording_of(model, path) for path in paths]
    if not logs:
        raise InputError("data: expected at least one recording, got none")
    return find_drift(model, logs, known_errors(card), factor=factor)


def known_errors(card: Card) -> Floats | None:
    """Return errors per joint on data that a model did not see [deg|mm]: of its last refresh, or of its fit."""
    if card.get("refreshed"):
        return np.array([joint["rmse_after"] for joint in card["refreshed"][-1]["joints"]])
    errors = card["errors"]
    if errors["held_out"]:
        return np.array([joint["rmse"] for joint in errors["held_out"]])
    if errors["cross_validation"]:
        return np.array([joint["rmse_mean"] for joint in errors["cross_validation"]["joints"]])
    return None


def since_in_words(found: DriftFound) -> list[str]:
    """Return a sentence for each joint on which the model no longer holds."""
    told = []
    for name, first in zip(found.joint_names, found.since, strict=True):
        if first is not None:
            stretch = found.stretches[first]
            when = stretch.date or f"recording {stretch.recording}, homing {stretch.homing}"
            told.append(f"{name}: beyond since {when}")
    return told


def drift_summary(found: DriftFound) -> dict[str, Any]:
    """Return what was found as plain data, errors in deg and mm."""
    return {
        "joints": found.joint_names,
        "judged_by": found.judged_by,
        "stretches": [asdict(stretch) for stretch in found.stretches],
        "beyond_since": dict(zip(found.joint_names, found.since, strict=True)),
        "in_words": since_in_words(found),
    }
