"""Bring a model's file up to date with recordings of a new day."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from catenary.calibration.card_schema import check_card
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.files import load_model
from catenary.calibration.fitting import data_notes, error_limits
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.upkeep.lineage import changes_shown, refreshed_card
from catenary.calibration.upkeep.refresh import Refreshed, refresh_model
from catenary.errors import InputError
from catenary.files import sha256_of
from catenary.workflows.fit import read_recording_of


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
    model_path: Path, paths: Sequence[Path], *, max_error: tuple[float, ...] | None = None
) -> RefreshResult:
    """Refresh a model with recordings of a new day; see `refresh_model`.

    Recordings that do not state their joints' names or units are read with the model's.

    Raises:
        FileFormatError: The model or a recording is missing or damaged.
        InputError: A recording is of other joints, lacks an input of the model, was trained on, or is too short.
    """
    model, card = load_model(model_path)
    check_card(card, str(model_path))
    logs = [read_recording_of(model, path) for path in paths]
    if not logs:
        raise InputError("data: expected at least one recording, got none")
    seen = {source["sha256"] for source in card["data"]} - {None}
    for log in logs:
        model.require_joints(log)
        if log.sha256 in seen:
            raise InputError(
                f'recording "{log.name}": the model was fitted to it or refreshed with it; '
                "expected one of a new day"
            )
    data = calibration_data(logs, model.features, max_error=error_limits(max_error, logs[0]))
    refreshed = refresh_model(model, data)
    notes = (*data_notes(logs, data), *refreshed.notes)
    return RefreshResult(
        refreshed.model,
        refreshed_card(card, refreshed, data, sha256=sha256_of(model_path)),
        refreshed,
        data,
        notes,
    )
