"""A model's error from recording to recording and homing to homing, and from when on it no longer holds.

A recording is cut where the encoders' offsets change, which a homing writes, and where its clock goes back.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card import clock_delay
from catenary.calibration.conformal import COVERAGE_LENIENCE
from catenary.calibration.dataset import usable_rows
from catenary.calibration.evaluate import evaluate
from catenary.calibration.model import CalibrationModel, Card
from catenary.calibration.model_maintenance import last_date
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.raven2.transmission import OFFSETS
from catenary.units import DISPLAY

DRIFT_FACTOR = 2.0  # times the error that the card tells, where a model has no interval


@dataclass(frozen=True)
class Stretch:
    """Errors of a model between two homings; deg and mm."""

    recording: str
    homing: int  # how many there were before in this recording
    date: str | None  # day of its first row (ISO 8601, UTC); None where time stamps are not a calendar's
    rows: int
    rmse: tuple[float, ...]
    coverage: tuple[float, ...] | None  # share of errors within the model's intervals; None if it has none
    beyond: tuple[bool, ...]  # per joint: the model no longer holds


@dataclass(frozen=True)
class CardStretch(Stretch):
    """What a card tells of its model, on data that it did not see; zeros in deg and mm, delays in s."""

    instrument: str | None
    tool: str | None
    delay: float | None  # of measurements behind commands, as they were recorded
    mends: Mapping[str, Sequence[str]]
    zeros: tuple[float, ...]  # what is added to each joint where nothing else is known


class DriftFound(NamedTuple):
    """Stretches in the order of recordings."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    stretches: tuple[Stretch, ...]
    judged_by: str  # what "beyond" means, in words

    @property
    def since(self) -> tuple[int | None, ...]:
        """Per joint, the first of the stretches from which the model never holds; None if the last one holds."""
        beyond = np.array([stretch.beyond for stretch in self.stretches], dtype=bool)
        first = [1 + max(np.flatnonzero(~column).tolist(), default=-1) for column in beyond.T]
        return tuple(row if row < len(beyond) else None for row in first)


def find_drift(
    model: CalibrationModel,
    recordings: Recordings,  # with q_encoder, the oldest first, joints as the model's
    known: Floats | None,  # (n,) errors that the card tells [deg|mm]; None if it tells none
    *,
    factor: float = DRIFT_FACTOR,  # more than 0
) -> DriftFound:
    """Return a model's errors on recordings in order, and the first one beyond its promise.

    With intervals, a joint is beyond where they hold less than half of what may lie outside allows (85 % for 90 %);
    without, where its RMSE exceeds `factor` times the error on the card. A model without either is an InputError.

    Args:
        recordings: Recordings with q_encoder, the oldest first, joints as the model's.
    """
    if model.intervals is None and known is None:
        raise InputError(
            "drift: the model has no intervals, and its card no error on data that it did not see; "
            "expected a model fitted with folds or a held-out part"
        )
    if not factor > 0.0:
        raise InputError(f"drift: factor: expected more than 0, got {factor}")
    least, judged = 0.0, f"RMSE beyond {factor:g} times the card's error"
    if model.intervals is not None:
        level = model.intervals.level
        least = level - COVERAGE_LENIENCE * (1.0 - level)
        judged = f"intervals that are to hold {level:.0%} of errors hold less than {least:.0%}"
    stretches = []
    for log in recordings.logs:
        data = usable_rows(replace(recordings, logs=(log,)), model.features)
        place = np.rint(data.position * len(log)).astype(int)  # rows of the recording
        offsets = [values for name, values in log.signals.items() if name.startswith(OFFSETS)]
        cuts = {*log.starts[1:], *(row + 1 for values in offsets for row in np.flatnonzero(np.diff(values)).tolist())}
        number = np.searchsorted(sorted(cuts), place, side="right")
        for homing in np.unique(number):
            rows = data.rows(number == homing)
            rmse, held = zip(*((joint.rmse, joint.coverage) for joint in evaluate(model, rows).joints), strict=True)
            lost = np.less(held, least) if known is None or model.intervals else np.greater(rmse, factor * known)
            shares, beyond = held if model.intervals else None, tuple(lost.tolist())
            stretches.append(Stretch(log.name, int(homing), rows.dates[0], len(rows), rmse, shares, beyond))
    return DriftFound(model.joint_names, model.joint_units, tuple(stretches), judged)


def find_card_drift(cards: Sequence[tuple[str, Card, Floats | None]], *, factor: float = DRIFT_FACTOR) -> DriftFound:
    """Return errors (n,) [deg|mm], delays and zeros of cards, by date; beyond is `factor` times the first one's.

    Args:
        cards: Name, card and errors of each model.
    """
    cards = sorted(cards, key=lambda each: last_date(each[1]) or "9")
    joints = [[(joint["name"], joint["unit"]) for joint in card["joints"]] for _, card, _ in cards]
    stretches: list[CardStretch] = []
    for (name, card, errors), has in zip(cards, joints, strict=True):
        if has != joints[0]:
            raise InputError(f"card {name}: is of joints {has}; expected those of {cards[0][0]}, {joints[0]}")
        if errors is None:
            raise InputError(f"card {name}: holds no error on unseen data")
        beyond = tuple(np.greater(errors, factor * np.array(stretches[0].rmse if stretches else errors)).tolist())
        zeros = tuple(DISPLAY[joint["unit"]][1] * joint["fixed_offset"] for joint in card["joints"])
        of_arm = card.get("instrument"), card.get("tool"), clock_delay(card), card.get("mends", {}), zeros
        stretches.append(
            CardStretch(name, 0, last_date(card), card["rows"], tuple(errors.tolist()), None, beyond, *of_arm)
        )
    judged = f"RMSE beyond {factor:g} times that of the first card, {cards[0][0]}"
    names, units = zip(*joints[0], strict=True)
    return DriftFound(names, units, tuple(stretches), judged)


def since_in_words(drift: DriftFound) -> list[str]:
    """Return a sentence for each joint on which the model no longer holds."""
    lines = []
    for name, first in zip(drift.joint_names, drift.since, strict=True):
        if first is not None:
            stretch = drift.stretches[first]
            when = stretch.date or f"recording {stretch.recording}, homing {stretch.homing}"
            lines.append(f"{name}: beyond since {when}")
    return lines
