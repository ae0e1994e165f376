"""A model's file against recordings of days: whether, and since when, it has drifted."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card_schema import check_card
from catenary.calibration.dataset import error_limits
from catenary.calibration.files import load_model
from catenary.calibration.model import Card
from catenary.calibration.upkeep.drift import BEYOND, DriftFound, find_drift, since_in_words
from catenary.calibration.upkeep.judged import judge_recordings, trained_limits
from catenary.recording.logs import Reading
from catenary.workflows.model_recordings import recordings_for


def drift_of_model(
    model_path: Path,
    paths: Sequence[Path],
    *,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
    factor: float = BEYOND,
    max_error: tuple[float, ...] | None = None,
) -> tuple[DriftFound, list[str]]:
    """Return a model's errors over recordings, in the order given, and notes on these; see `find_drift`.

    Args:
        model_path: The model's file.
        paths: The recordings; what they do not say of their joints' names and units is the model's.
        reading: Mapping of recordings of another make, and what to change of them.
        accept: Findings about them to go on with, by name.
        factor: Of the card's error, for a model without intervals.
        max_error: Per joint, deg and mm; rows with larger errors are left out.

    Raises:
        DataError: Something is wrong with a recording that `accept` does not name: it is no drift.
        FileFormatError: The model or a recording is missing or damaged.
        InputError: As `find_drift`.
    """
    model, card = load_model(model_path)
    check_card(card, str(model_path))
    logs = recordings_for(model, paths, reading)
    max_error, said = trained_limits(card, max_error, as_trained=reading is None or reading.as_trained)
    limits = error_limits(max_error, logs[0])
    notes = [*(f"{log.name}: {note}" for log in logs for note in log.notes), *said]
    notes += judge_recordings(model, card, logs, accept=accept, max_error=limits, done="judged")
    return find_drift(model, logs, known_errors(card), factor=factor, max_error=limits), notes


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


def drift_summary(found: DriftFound, notes: Sequence[str] = ()) -> dict[str, Any]:
    """Return what was found as plain data, errors in deg and mm."""
    return {
        "joints": found.joint_names,
        "judged_by": found.judged_by,
        "stretches": [asdict(stretch) for stretch in found.stretches],
        "beyond_since": dict(zip(found.joint_names, found.since, strict=True)),
        "in_words": since_in_words(found),
        "notes": list(notes),
    }
