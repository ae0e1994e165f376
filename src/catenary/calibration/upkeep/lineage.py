"""What a refreshed model's card says of where it comes from: of which model, what moved, by how much, since when."""

from copy import deepcopy
from dataclasses import asdict
from datetime import datetime
from typing import Any

from catenary.calibration.card import valid_inputs
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.model import Card
from catenary.calibration.upkeep.refresh import NOTHING, JointChange, Refreshed
from catenary.units import DISPLAY


def refreshed_card(card: Card, refreshed: Refreshed, data: CalibrationData, *, sha256: str | None) -> Card:
    """Return the card of a refreshed model: the old one's, its history one entry longer.

    Args:
        card: Of the old model.
        refreshed: What became of it.
        data: The rows of the new day.
        sha256: Of the old model's file; None for one in memory.
    """
    new = deepcopy(card)
    model = refreshed.model
    widths = model.intervals
    for j, entry in enumerate(new["joints"]):
        entry["fixed_offset"] = float(model.offset[j])
        entry["half_width"] = None if widths is None else float(widths.inside[j])
        entry["half_width_outside"] = None if widths is None else float(widths.outside[j])
    if widths is None:
        new["intervals"] = None
    ranges = valid_inputs(model)
    for entry in new["inputs"]:
        if entry["name"] in ranges:
            entry["valid"] = ranges[entry["name"]]
    new["data"] += [asdict(source) for source in data.sources]
    new["rows"] += len(data)
    since = last_date(card)
    new["refreshed"] = [
        *new.get("refreshed", []),
        {
            "model_sha256": sha256,
            "recordings": [{"name": s.name, "sha256": s.sha256} for s in data.sources],
            "rows": len(data),
            "recorded": data.dates[1],
            "since": since,
            "moved": moved_in_words(refreshed.changes, since),
            "joints": changes_shown(refreshed.changes),
            "notes": list(refreshed.notes),
        },
    ]
    return new


def changes_shown(changes: tuple[JointChange, ...]) -> list[dict[str, Any]]:
    """Return what became of each joint as plain data, in deg and mm."""
    return [
        {
            "name": change.joint,
            "unit": DISPLAY[change.unit][0],
            "change": change.how,
            "moved": DISPLAY[change.unit][1] * change.moved,
            "rmse_before": DISPLAY[change.unit][1] * change.before,
            "rmse_after": DISPLAY[change.unit][1] * change.after,
        }
        for change in changes
    ]


def moved_in_words(changes: tuple[JointChange, ...], since: str | None) -> str:
    """Return what moved, by most of its remaining error first: "J5 +2.9 deg, J3 +0.98 mm since 14 May 2026"."""
    told = [
        f"{change.joint} {DISPLAY[change.unit][1] * change.moved:+.2g} {DISPLAY[change.unit][0]}"
        for change in sorted(changes, key=lambda each: -abs(each.moved) / max(each.after, 1e-12))
        if change.how != NOTHING
    ]
    when = "since the model was fitted" if since is None else f"since {_in_words(since)}"
    return f"{', '.join(told)} {when}" if told else f"nothing moved {when}"


def last_date(card: Card) -> str | None:
    """Return the date of the last recording that a model was fitted to or refreshed with (ISO 8601); None unknown."""
    entries = card.get("refreshed", [])
    if entries and entries[-1].get("recorded"):
        return str(entries[-1]["recorded"])
    found = card.get("recorded")
    return None if found is None else str(found)


def _in_words(iso: str) -> str:
    day = datetime.fromisoformat(iso)
    return f"{day.day} {day:%B %Y}"
