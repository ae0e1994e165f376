"""Recordings of a new day, judged, and the model refreshed with them: what command and Python both do."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

from catenary.calibration.dataset import CalibrationData, calibration_data, data_notes, error_limits
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.upkeep.judged import judge_recordings
from catenary.calibration.upkeep.lineage import changes_shown, refreshed_card
from catenary.calibration.upkeep.refresh import Refreshed, refresh_model
from catenary.errors import InputError
from catenary.plant import MotionLog


@dataclass(frozen=True)
class NewDay:
    """What a new day made of a model: what became of each joint, its card, the rows, and what to know."""

    refreshed: Refreshed
    card: Card
    data: CalibrationData
    notes: tuple[str, ...]

    @property
    def model(self) -> CalibrationModel:
        """The refreshed model."""
        return self.refreshed.model

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


def refresh_with(
    model: CalibrationModel,
    card: Card,
    logs: Sequence[MotionLog],
    *,
    accept: Collection[str] = (),
    max_error: tuple[float, ...] | None = None,
    sha256: str | None = None,
) -> NewDay:
    """Refresh a model with recordings of a new day; see `refresh_model`.

    Args:
        model: The model.
        card: Its card.
        logs: Recordings of its joints.
        accept: Findings about them to go on with, by name.
        max_error: Per joint, deg and mm; rows with larger errors are left out.
        sha256: Of the model's file; None for one in memory.

    Raises:
        DataError: Something is wrong with a recording that `accept` does not name.
        InputError: A recording was trained on, lacks an input of the model, or is too short.
    """
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
    notes = (*data_notes(logs, data), *found, *refreshed.notes)
    return NewDay(refreshed, refreshed_card(card, refreshed, data, sha256=sha256), data, notes)
