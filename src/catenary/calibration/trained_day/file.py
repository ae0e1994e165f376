"""A day of training inside a model's file: plain structure and named arrays, checked when they are read."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any, Literal

from numpy.typing import NDArray
from pydantic import Field

from catenary.calibration.features import FeatureSet
from catenary.calibration.predictors import Quadratic
from catenary.calibration.trained_day.day import TrainedDay, TrainedTorque, UsualBounds
from catenary.calibration.valid_range import ValidRange
from catenary.config import Recorded
from catenary.robots.plausible import FARTHEST, check_within

Arrays = dict[str, NDArray[Any]]
PREFIX = "day."
_PREDICTOR, _RANGE = (tuple(each.name for each in fields(kind)) for kind in (Quadratic, ValidRange))
Words = Annotated[str, Field(max_length=1_000)]


class DayStructure(Recorded):
    """All of a day but its arrays."""

    window: Annotated[float, Field(gt=0.0, le=1e6)]
    # of the torque's features: joints, their units, play states with half-widths; None where no torque is known
    signals: Annotated[tuple[str, ...], Field(max_length=10_000)] | None = None
    units: Annotated[tuple[Literal["rad", "m"], ...], Field(max_length=10_000)] = ()
    play: Annotated[tuple[tuple[str, Annotated[float, Field(gt=0.0)]], ...], Field(max_length=10_000)] = ()
    knows_range: bool = False
    knows_homing: bool = False
    not_watched: Annotated[tuple[Words, ...], Field(max_length=10_000)] = ()


def day_structure(day: TrainedDay) -> dict[str, Any]:
    """Return what `DayStructure` reads."""
    features = None if day.torque is None else day.torque.features
    return {
        "window": day.window,
        "signals": None if features is None else features.signals,
        "units": () if features is None else features.units,
        "play": () if features is None else features.play,
        "knows_range": day.outside is not None,
        "knows_homing": day.homing is not None,
        "not_watched": day.not_watched,
    }


def day_arrays(day: TrainedDay) -> Arrays:
    """Return the arrays of a day by their names in a model's file."""
    arrays: Arrays = {"reach": day.reach}
    if day.outside is not None:
        arrays["outside"] = day.outside
    if day.homing is not None:
        arrays |= {"homing.lower": day.homing.lower, "homing.upper": day.homing.upper}
    if day.torque is not None:
        arrays |= {f"torque.{key}": getattr(day.torque.predictor, key) for key in _PREDICTOR}
        arrays |= {f"range.{key}": getattr(day.torque.valid_range, key) for key in _RANGE}
        arrays |= {"usual.lower": day.torque.usual.lower, "usual.upper": day.torque.usual.upper}
    return {f"{PREFIX}{name}": values for name, values in arrays.items()}


def day_of(structure: DayStructure, file: Mapping[str, NDArray[Any]]) -> TrainedDay:
    """Return the day that a model's file holds.

    Raises:
        KeyError: An array is missing.
        InputError: Arrays do not fit together, or no robot can be so.
    """
    arrays = {name.removeprefix(PREFIX): values for name, values in file.items() if name.startswith(PREFIX)}
    check_within("reach of the training", arrays["reach"], FARTHEST, "rad or m")
    torque = None
    if structure.signals is not None:
        torque = TrainedTorque(
            FeatureSet(structure.signals, structure.units, play=structure.play),
            Quadratic(**{key: arrays[f"torque.{key}"] for key in _PREDICTOR}),
            ValidRange(**{key: arrays[f"range.{key}"] for key in _RANGE}),
            UsualBounds(arrays["usual.lower"], arrays["usual.upper"]),
        )
    return TrainedDay(
        structure.window,
        arrays["reach"],
        torque,
        arrays["outside"] if structure.knows_range else None,
        UsualBounds(arrays["homing.lower"], arrays["homing.upper"]) if structure.knows_homing else None,
        structure.not_watched,
    )
