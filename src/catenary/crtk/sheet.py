"""A server's frames side by side in memory, into which one compiled call writes a tick's stamp and numbers.

Python's way to a few hundred numbers, view by view, costs more than sending them; here they are a list of runs, each
some numbers from one array to a place among the bytes. What the bytes mean is told by frames.py alone.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.frames import KINDS, STAMP_AT, Frame
from catenary.errors import InputError
from catenary.kernels.compiled import compiled_quick

Bytes = NDArray[np.uint8]
Whole = NDArray[np.int64]
PLACE, SIZE, HEARD, COUNT = range(4)  # columns of `Sheet.topics`


class Sheet:
    """Frames, one a topic, and the numbers that are written into them."""

    def __init__(self, frames: Sequence[Frame], size: int) -> None:
        """Lay out frames whose numbers are among `size`.

        Raises:
            InputError: A frame asks for numbers that are not there, or has no room for those it asks for.
        """
        self.numbers = np.zeros(size)
        rooms = [max(frame.room, len(frame.content)) for frame in frames]
        begins = np.concatenate([[0], np.cumsum(rooms, dtype=np.int64)])
        self.memory = np.zeros(int(begins[-1]), dtype=np.uint8)
        # where each topic's frame begins, its length, whether it is to be sent, and how many were
        self.topics = np.zeros((len(frames), 4), dtype=np.int64)
        self.topics[:, PLACE] = begins[:-1]
        self.heard = self.topics[:, HEARD]  # to be written
        self._rooms = rooms
        runs, factors = [], []
        for k, frame in enumerate(frames):
            self.replace(k, frame.content)
            for part in frame.numbers:
                end = part.place + part.many * np.dtype(part.kind).itemsize
                sources = [part.source, part.source if part.plus is None else part.plus]
                if min(sources) < 0 or max(sources) + part.many > size or end > len(frame.content):
                    raise InputError(f"frame {k}: {part} of {size} numbers, {len(frame.content)} bytes")
                plus = -1 if part.plus is None else part.plus
                runs.append((begins[k] + part.place, KINDS.index(part.kind), part.source, part.many, plus))
                factors.append(part.factor)
        self._runs = np.array(runs, dtype=np.int64).reshape(len(runs), 5)
        self._factors = np.array(factors, dtype=float)

    def replace(self, topic: int, content: bytes | bytearray) -> None:
        """Put another message of no numbers in the place of a topic's.

        Raises:
            InputError: There is no room for it.
        """
        if len(content) > self._rooms[topic]:
            raise InputError(f"frame {topic}: {len(content)} bytes, room for {self._rooms[topic]}")
        begin = int(self.topics[topic, PLACE])
        self.memory[begin : begin + len(content)] = np.frombuffer(content, dtype=np.uint8)
        self.topics[topic, SIZE] = len(content)

    def frame(self, topic: int) -> memoryview:
        """Give a topic's frame, which the next tick changes."""
        begin, length = self.topics[topic, : SIZE + 1].tolist()
        return self.memory.data[begin : begin + length]

    def write(self, stamp: int) -> None:
        """Write the numbers and a stamp [ns] into all frames."""
        seconds, nanoseconds = divmod(stamp, SECOND)
        write_frames(self.memory, self.topics, self._runs, self._factors, self.numbers, seconds, nanoseconds)


@compiled_quick
def write_frames(
    memory: Bytes,
    topics: Whole,
    runs: Whole,
    factors: Floats,
    numbers: Floats,
    seconds: int,
    nanoseconds: int,
) -> None:
    """Write a stamp into every frame, and runs of numbers.

    Args:
        memory: Where the frames lie.
        topics: (t, 4) frames.
        runs: (r, 5) place in memory, kind, first number, count, first number to add or -1.
        factors: (r,) from numbers to those of the message.
        numbers: What is written.
        seconds: Of the stamp.
        nanoseconds: Of the stamp.
    """
    double, single, whole = np.empty(1), np.empty(1, dtype=np.float32), np.empty(1, dtype=np.int32)
    of_double, of_single, of_whole = double.view(np.uint8), single.view(np.uint8), whole.view(np.uint8)
    for t in range(len(topics)):
        place = topics[t, PLACE] + STAMP_AT
        for k in range(4):
            memory[place + k] = (seconds >> (8 * k)) & 255
            memory[place + 4 + k] = (nanoseconds >> (8 * k)) & 255
    for r in range(len(runs)):
        place, kind, source, count = runs[r, 0], runs[r, 1], runs[r, 2], runs[r, 3]
        for i in range(count):
            value = numbers[source + i]
            if runs[r, 4] >= 0:
                value += numbers[runs[r, 4] + i]
            value *= factors[r]
            if kind == 0:
                double[0] = value
                for k in range(8):
                    memory[place + k] = of_double[k]
                place += 8
            elif kind == 1:
                single[0] = value
                for k in range(4):
                    memory[place + k] = of_single[k]
                place += 4
            else:
                whole[0] = np.int32(value)
                for k in range(4):
                    memory[place + k] = of_whole[k]
                place += 4
