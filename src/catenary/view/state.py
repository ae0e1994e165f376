"""The state that the view shows: one instant, as numbers and words, in memory shared by two processes."""

import pickle
import struct
from collections.abc import Mapping
from multiprocessing.shared_memory import SharedMemory
from typing import Any, NamedTuple, Self
from zlib import crc32

import numpy as np

from catenary.arrays import Floats

TEXT = 16384  # bytes that words may take: more than MOST_WARNINGS and a mode of four bytes a character
OF_A_JOINT = 128  # bytes: nine numbers, and to spare
MOST_WARNINGS = 6
LONGEST = 140  # characters of a warning
TRIES = 5  # reads of a state that is written meanwhile
_HEAD = struct.Struct("<QQI")  # number of the state, its bytes, their checksum


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
    gravity_age: float = np.inf  # [s]; infinite for gravity that is not measured
    rate: float = np.nan  # at which ticks come, as a share of what it should be
    late: float = 0.0  # ticks late within the last second
    mode: str = ""  # what the robot does, in words
    warnings: tuple[str, ...] = ()
    values: Mapping[str, float | bool | str] = {}  # of the page's controls, where the program has set them


_JOINTS = ("q", "calibrated", "interval", "inside", "true", "setpoint", "tau", "gravity_tau", "feedback")
_VECTORS = ("gravity", "assumed", "actual")


def unknown_state(n: int) -> ViewState:
    """Return the state of an arm of n joints of which nothing is known yet."""
    joints: dict[str, Any] = {name: np.full(n, np.nan) for name in _JOINTS}
    vectors: dict[str, Any] = {name: np.full(3, np.nan) for name in _VECTORS}
    return ViewState(time=0.0, **joints, **vectors)


def _as_bytes(state: ViewState) -> bytes:
    warnings = tuple(_word(warning) for warning in state.warnings[:MOST_WARNINGS])
    return pickle.dumps(state._replace(mode=_word(state.mode), warnings=warnings, values=dict(state.values)))


def _word(text: str) -> str:
    """Return a text cut, and without what is none, as in a file's name."""
    return text[:LONGEST].encode(errors="replace").decode()


class SharedState:
    """One state, the newest. A reader tells by its checksum whether it was read whole, on any processor.

    Neither side locks: a reader that is slow or gone costs the writer nothing, and it may miss states in between.
    """

    def __init__(self, n: int, name: str | None = None) -> None:
        """Make the memory for a state of n joints, or open that of another process by its name."""
        self._room = TEXT + OF_A_JOINT * n
        self._memory = SharedMemory(name, create=name is None, size=_HEAD.size + self._room)
        self._is_owner = name is None
        self.name = self._memory.name
        self._bytes = self._memory.buf  # None once it is closed
        self._seen = self._number = 0

    def put(self, state: ViewState) -> None:
        """Leave a state in place of the last one; its controls' values are left out where there is no room for them."""
        if self._bytes is None:
            return
        content = _as_bytes(state)
        if len(content) > self._room:
            content = _as_bytes(state._replace(values={}))
        self._number += 1
        whole = _HEAD.pack(self._number, len(content), crc32(content)) + content
        self._bytes[: len(whole)] = whole

    def take(self) -> ViewState | None:
        """Return the newest state; None when none came since the last one that was taken."""
        for _ in range(0 if self._bytes is None else TRIES):
            copy = bytes(self._bytes or b"")
            number, size, checksum = _HEAD.unpack_from(copy)
            if number == self._seen:
                return None
            content = copy[_HEAD.size : _HEAD.size + size]
            if crc32(content) == checksum:
                self._seen = number
                state: ViewState = pickle.loads(content)  # memory of this program's own
                return state
        return None

    def close(self) -> None:
        """Let go of the memory; it is gone once its owner has."""
        self._bytes = None
        self._memory.close()
        if self._is_owner:
            self._memory.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
