"""Bring a model's file up to date with recordings of a new day."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from catenary.calibration.card_schema import check_card
from catenary.calibration.files import load_model
from catenary.calibration.upkeep.judged import trained_limits
from catenary.calibration.upkeep.new_day import NewDay, refresh_with
from catenary.files import sha256_of
from catenary.recording.logs import Reading
from catenary.workflows.model_recordings import recordings_for


def refresh_calibration(
    model_path: Path,
    paths: Sequence[Path],
    *,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
    max_error: tuple[float, ...] | None = None,
) -> NewDay:
    """Refresh a model with recordings of a new day; see `refresh_with`.

    Args:
        model_path: The model's file.
        paths: The recordings; what they do not say of their joints' names and units is the model's.
        reading: Mapping of recordings of another make, and what to change of them.
        accept: Findings about them to go on with, by name.
        max_error: Per joint, deg and mm; rows with larger errors are left out.

    Raises:
        DataError: Something is wrong with a recording that `accept` does not name.
        FileFormatError: The model or a recording is missing or damaged.
        InputError: A recording is of other joints, lacks an input of the model, was trained on, or is too short.
    """
    model, card = load_model(model_path)
    check_card(card, str(model_path))
    logs = recordings_for(model, paths, reading)
    max_error, said = trained_limits(card, max_error, as_trained=reading is None or reading.as_trained)
    day = refresh_with(model, card, logs, accept=accept, max_error=max_error, sha256=sha256_of(model_path))
    return replace(day, notes=(*day.notes, *said))
