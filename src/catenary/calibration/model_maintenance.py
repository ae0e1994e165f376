"""A model and recordings of another day: mended and judged as its training data were, refreshed with them, its card.

What is wrong with the data is no fault of the model: recordings are judged before one is held against them.
"""

from collections.abc import Collection
from copy import deepcopy
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card import sizes_of, valid_inputs
from catenary.calibration.dataset import CalibrationData, data_notes, usable_rows
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_refresh import UNCHANGED, JointChange, Refreshed, refresh_model
from catenary.calibration.recordings import Recordings
from catenary.errors import DataError, InputError
from catenary.plant import MotionLog
from catenary.verdict.corrections import AS_TRAINED, NO_MEND, Mend
from catenary.verdict.units_and_scale import trained_findings


def judge_recordings(
    model: CalibrationModel,
    recordings: Recordings,
    *,
    accept: Collection[str] = (),
    learning: bool = False,  # the model is to learn from them: they must not be short, nor the arm at rest
    done: str = "evaluated",
) -> list[str]:
    """Refuse recordings on which a model's error means nothing; return notes on the others.

    Args:
        accept: Names of findings to continue despite.
        done: What is done with them, for messages.
    """
    try:
        return recordings.judged(accept, testing=not learning, trained=trained_positions(model), done=done).notes
    except DataError as error:
        corrected = [f'"{log.name}" was {n}' for log in recordings.logs for n in log.notes if n.startswith(AS_TRAINED)]
        raise DataError("\n".join([str(error), *corrected]), error.names) from error


def mended_as_trained(model: CalibrationModel, log: MotionLog, own: Mend = NO_MEND) -> MotionLog:
    """Return a recording corrected as asked, and as the training data; units only where that brings it near these.

    Args:
        model: The model, which keeps the corrections of its training data.
    """
    trained = dict(model.mends)
    if "units" in trained and len(log.joint_names) == len(model.joint_names):
        other = trained_findings(model.matched(log), trained_positions(model))
        trained = trained if other else {key: texts for key, texts in trained.items() if key != "units"}
    return own(log, trained)


def trained_limits(
    card: Card, max_error: tuple[float, ...] | None = None, *, as_trained: bool = True
) -> tuple[tuple[float, ...] | None, list[str]]:
    """Return the errors beyond which rows are left out [deg|mm], and notes.

    Args:
        max_error: Limits; the model's own when None.
        as_trained: Whether the model's own limits apply where none are asked for.
    """
    kept = card.get("run", {}).get("max_error") if as_trained and max_error is None else None
    if kept is None:
        return max_error, []
    limits = tuple(np.inf if limit is None else float(limit) for limit in kept)
    text = ",".join(f"{limit:g}" for limit in limits)
    return limits, [f"{AS_TRAINED}: --max-error {text}; --as-is takes all rows"]


def trained_positions(model: CalibrationModel) -> tuple[Floats, Floats]:
    """Return least and largest trained positions, margins included, (n,) [rad|m]; infinite where none is watched."""
    ranges, anywhere = valid_inputs(model), {"lower": -np.inf, "upper": np.inf}
    held = [ranges.get(f"q:{joint}", anywhere) for joint in model.joint_names]
    return np.array([joint["lower"] for joint in held]), np.array([joint["upper"] for joint in held])


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
        """Changes by the refresh as text."""
        return str(self.card["refreshed"][-1]["moved"])

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in deg and mm."""
        joints = [asdict(change) for change in self.refreshed.changes]
        return {"moved": self.moved, "rows": len(self.data), "joints": joints, "notes": list(self.notes)}


def refresh_with(
    model: CalibrationModel,
    card: Card,
    recordings: Recordings,
    *,
    accept: Collection[str] = (),
    sha256: str | None = None,  # of the model's file; None for one in memory
) -> NewDay:
    """Refresh a model with recordings of a new day; see `refresh_model`.

    Args:
        accept: Names of findings to continue despite.
    """
    for log in recordings.logs:
        if log.is_among(card["data"]):
            raise InputError(
                f'recording "{log.name}": the model was fitted to it or refreshed with it; expected one of a new day'
            )
    judged = judge_recordings(model, recordings, accept=accept, learning=True, done="refreshed")
    data = usable_rows(recordings, model.features)
    refreshed = refresh_model(model, data, recordings)
    notes = (*data_notes(recordings.logs, data), *judged, *refreshed.notes)
    return NewDay(refreshed, refreshed_card(card, refreshed, data, sha256=sha256), data, notes)


def refreshed_card(card: Card, refreshed: Refreshed, data: CalibrationData, *, sha256: str | None) -> Card:
    """Return the card of a refreshed model: the old one's, its history one entry longer."""
    new = deepcopy(card)
    model = refreshed.model
    for j, entry in enumerate(new["joints"]):
        entry.update(sizes_of(model, j))
    if model.intervals is None:
        new["intervals"] = None
    ranges = valid_inputs(model)
    for entry in new["inputs"]:
        if entry["name"] in ranges:
            entry["valid"] = ranges[entry["name"]]
    new["data"] += [asdict(source) for source in data.sources]
    new["rows"] += len(data)
    since = last_date(card)
    this = {
        "model_sha256": sha256,
        "recordings": [{"name": s.name, "sha256": s.sha256} for s in data.sources],
        "rows": len(data),
        "recorded": data.dates[1],
        "since": since,
        "moved": moved_in_words(refreshed.changes, since),
        "joints": [asdict(change) for change in refreshed.changes],
        "notes": list(refreshed.notes),
    }
    return new | {"refreshed": [*new.get("refreshed", []), this]}


def moved_in_words(changes: tuple[JointChange, ...], since: str | None) -> str:
    """Return the changes, largest share of its remaining error first: "J5 +2.9 deg, J3 +0.98 mm since 14 May 2026"."""
    parts = [
        f"{change.name} {change.moved:+.2g} {change.unit}"
        for change in sorted(changes, key=lambda each: -abs(each.moved) / max(each.rmse_after, 1e-9))
        if change.change != UNCHANGED
    ]
    day = None if since is None else datetime.fromisoformat(since)
    when = "since the model was fitted" if day is None else f"since {day.day} {day:%B %Y}"
    return f"{', '.join(parts)} {when}" if parts else f"nothing moved {when}"


def last_date(card: Card) -> str | None:
    """Return the date of the last recording that a model was fitted to or refreshed with (ISO 8601); None unknown."""
    days = [day["recorded"] for day in card.get("refreshed", [])[-1:] if day.get("recorded")]
    date = days[0] if days else card.get("recorded")
    return None if date is None else str(date)
