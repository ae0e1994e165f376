"""Bring a model's file up to date with recordings of a new day."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from catenary.calibration.card_schema import check_card
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.files import load_model
from catenary.calibration.fitting import data_notes, error_limits
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.upkeep.judged import judge_recordings
from catenary.calibration.upkeep.learn_day import on_new_day
from catenary.calibration.upkeep.lineage import changes_shown, refreshed_card
from catenary.calibration.upkeep.refresh import Refreshed, refresh_model
from catenary.errors import InputError
from catenary.files import sha256_of
from catenary.recording.foreign.read import Reading
from catenary.workflows.model_recordings import recordings_for


@dataclass(frozen=True)
class RefreshResult:
    """A refreshed model with its card, and what became of each joint."""

    model: CalibrationModel
    card: Card
    refreshed: Refreshed
    data: CalibrationData
    notes: tuple[str, ...]

    @property
    def moved(self) -> str:
        """What moved, in words."""
        return str(self.card["refreshed"][-1]["moved"])

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in deg and mm."""
        return {
            "moved": self.moved,
            "rows": len(self.data),
            "joints": changes_shown(self.refreshed.changes),
            "notes": list(self.notes),
        }


def refresh_calibration(
    model_path: Path,
    paths: Sequence[Path],
    *,
    reading: Reading | None = None,
    accept: tuple[str, ...] = (),
    max_error: tuple[float, ...] | None = None,
) -> RefreshResult:
    """Refresh a model with recordings of a new day; see `refresh_model`.

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
    seen = {source["sha256"] for source in card["data"]} - {None}
    for log in logs:
        if log.sha256 in seen:
            raise InputError(
                f'recording "{log.name}": the model was fitted to it or refreshed with it; '
                "expected one of a new day"
            )
    limits = error_limits(max_error, logs[0])
    found = judge_recordings(
        model, card, logs, accept=accept, max_error=limits, learning=True, done="refreshed"
    )
    data = calibration_data(logs, model.features, max_error=limits)
    refreshed = refresh_model(model, data)
    refreshed = replace(refreshed, model=on_new_day(refreshed.model, logs))
    notes = (*data_notes(logs, data), *found, *refreshed.notes)
    return RefreshResult(
        refreshed.model,
        refreshed_card(card, refreshed, data, sha256=sha256_of(model_path)),
        refreshed,
        data,
        notes,
    )
