"""The latest state of an arm in memory that two processes share: whoever writes it never waits for who reads it."""

from multiprocessing.shared_memory import SharedMemory
from typing import Any, Self
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from catenary.view.state import ViewState, read_state, state_record, write_state

TRIES = 5  # reads of a state that is written meanwhile
_HEAD = np.dtype([("number", np.uint64), ("sum", np.uint64)])


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
