"""What a program hands to the view of an arm: one instant, as numbers and words."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats

TEXT = 6144  # bytes that words may take: more than MOST_WARNINGS and a mode of six bytes a character
MOST_WARNINGS = 6
LONGEST = 140  # characters of a warning


class ViewState(NamedTuple):
    """An arm at one instant; NaN for what is not known. Joints are the model's."""

    time: float  # [s] of the robot
    q: Floats  # (n,) [rad|m] reported
    calibrated: Floats  # (n,) [rad|m]
    interval: Floats  # (n,) half-width about `calibrated` [rad|m]
    inside: Floats  # (n,) 1 inside the model's valid range, 0 outside
    true: Floats  # (n,) [rad|m]
    setpoint: Floats  # (n,) [rad|m]
    tau: Floats  # (n,) [Nm|N] as commanded
    gravity_tau: Floats  # (n,) [Nm|N] what holds the arm still
    feedback: Floats  # (n,) [Nm|N] what the errors asked for: the PD term
    gravity: Floats  # (3,) [m/s2] as measured, in the base frame
    assumed: Floats  # (3,) [m/s2] as the controller takes it to be
    actual: Floats  # (3,) [m/s2] as it is, which a simulation knows
    gravity_age: float = np.inf  # [s]; infinite for gravity that nobody measures
    rate: float = np.nan  # at which ticks come, as a share of what it should be
    late: float = 0.0  # ticks late within the last second
    mode: str = ""  # what the robot does, in words
    warnings: tuple[str, ...] = ()
    values: Mapping[str, float | bool | str] = {}  # of the page's controls, where the program has set them


_JOINTS = ("q", "calibrated", "interval", "inside", "true", "setpoint", "tau", "gravity_tau", "feedback")
_VECTORS = ("gravity", "assumed", "actual")
_NUMBERS = ("time", "gravity_age", "rate", "late")


def unknown_state(n: int) -> ViewState:
    """Return the state of an arm of n joints of which nothing is known yet."""
    joints: dict[str, Any] = {name: np.full(n, np.nan) for name in _JOINTS}
    vectors: dict[str, Any] = {name: np.full(3, np.nan) for name in _VECTORS}
    return ViewState(time=0.0, **joints, **vectors)


def state_record(n: int) -> np.dtype[Any]:
    """Return the layout of a state of n joints in memory that two processes share."""
    return np.dtype(
        [
            *((name, np.float64, (n,)) for name in _JOINTS),
            *((name, np.float64, (3,)) for name in _VECTORS),
            *((name, np.float64) for name in _NUMBERS),
            ("text", np.uint8, (TEXT,)),
            ("text_length", np.int64),
        ]
    )


def write_state(state: ViewState, record: NDArray[Any]) -> None:
    """Write a state into a record () of that layout; words that do not fit are left out."""
    for name in (*_JOINTS, *_VECTORS, *_NUMBERS):
        record[name] = getattr(state, name)
    warnings = [warning[:LONGEST] for warning in state.warnings[:MOST_WARNINGS]]
    words = {"mode": state.mode[:LONGEST], "warnings": warnings, "values": dict(state.values)}
    text = _as_bytes(words)
    if len(text) > TEXT:
        text = _as_bytes({**words, "values": {}})
    record["text"][: len(text)] = np.frombuffer(text, np.uint8)
    record["text_length"] = len(text)


def _as_bytes(words: Mapping[str, Any]) -> bytes:
    return json.dumps(words, ensure_ascii=False).encode(errors="replace")


def read_state(record: NDArray[Any]) -> ViewState:
    """Return the state that a record () holds."""
    text = record["text"][: int(record["text_length"])].tobytes()
    words = json.loads(text)
    arrays: dict[str, Any] = {name: np.array(record[name]) for name in (*_JOINTS, *_VECTORS)}
    numbers: dict[str, Any] = {name: float(record[name]) for name in _NUMBERS}
    return ViewState(
        **arrays, **numbers, mode=words["mode"], warnings=tuple(words["warnings"]), values=words["values"]
    )
