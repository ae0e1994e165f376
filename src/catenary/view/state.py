"""What a program hands to the view of an arm: one instant, as numbers and words, in memory that two processes share."""

import json
from collections.abc import Mapping
from multiprocessing.shared_memory import SharedMemory
from typing import Any, NamedTuple, Self
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats

TEXT = 6144  # bytes that words may take: more than MOST_WARNINGS and a mode of six bytes a character
MOST_WARNINGS = 6
LONGEST = 140  # characters of a warning
TRIES = 5  # reads of a state that is written meanwhile
_HEAD = np.dtype([("number", np.uint64), ("sum", np.uint64)])


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
    return ViewState(**arrays, **numbers, mode=words["mode"], warnings=tuple(words["warnings"]), values=words["values"])


class SharedState:
    """One state, the newest. A reader tells by its checksum whether it was read whole, on any processor.

    Neither side locks: a reader that is slow or gone costs the writer nothing, and it may miss states in between.
    """

    def __init__(self, n: int, name: str | None = None) -> None:
        """Make the memory for a state of n joints, or open that of another process by its name."""
        layout = state_record(n)
        self._memory = SharedMemory(name, create=name is None, size=_HEAD.itemsize + layout.itemsize)
        self._is_owner = name is None
        self.name = self._memory.name
        self._layout = layout
        size = _HEAD.itemsize + layout.itemsize
        self._whole: NDArray[np.uint8] | None = np.ndarray(size, np.uint8, buffer=self._memory.buf)
        self._record: NDArray[Any] = np.zeros((), layout)  # made here, then copied at once
        self._seen = 0
        self._number = 0

    def put(self, state: ViewState) -> None:
        """Leave a state in place of the last one."""
        if self._whole is None:
            return
        write_state(state, self._record)
        content = self._record.tobytes()
        self._number += 1
        head = np.array((self._number, crc32(content)), _HEAD).tobytes()
        self._whole[:] = np.frombuffer(head + content, np.uint8)

    def take(self) -> ViewState | None:
        """Return the newest state; None when none came since the last one that was taken."""
        if self._whole is None:
            return None
        for _ in range(TRIES):
            copy = self._whole.tobytes()
            head = np.frombuffer(copy, _HEAD, count=1)[0]
            number = int(head["number"])
            if number == self._seen:
                return None
            content = copy[_HEAD.itemsize :]
            if int(head["sum"]) == crc32(content):
                self._seen = number
                return read_state(np.frombuffer(content, self._layout, count=1)[0])
        return None

    def close(self) -> None:
        """Let go of the memory; it is gone once its owner has."""
        self._whole = None
        self._memory.close()
        if self._is_owner:
            self._memory.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
