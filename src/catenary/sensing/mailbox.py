"""Samples of a sensor on their way from the thread that receives them to the control tick."""

from collections import deque
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from catenary.arrays import Floats

MAILBOX = 1024  # samples; 5 s of an accelerometer at 200 Hz


class Kind(Enum):
    """The quantity that a sample is of."""

    SPECIFIC_FORCE = "specific force"  # [m/s2] what an accelerometer reads: upwards at rest
    FREE_FALL = "free-fall acceleration"  # [m/s2] the opposite: gravity, downwards at rest
    ANGULAR_RATE = "angular rate"  # [rad/s]


class SensorSample(NamedTuple):
    """One reading, in the sensor's axes."""

    stamp: float  # [s] when it was taken, on the clock of JointState.time
    vector: tuple[float, float, float]
    kind: Kind


class Mailbox:
    """Where any thread puts samples and the control tick takes them; neither ever waits for the other.

    Nothing is checked here: that is for the reader. A full mailbox drops the oldest samples, and counts them.
    """

    def __init__(self, size: int = MAILBOX) -> None:
        """Make room for `size` samples."""
        # append, popleft and len of a deque are atomic
        self._samples: deque[SensorSample] = deque(maxlen=size)
        self._size = size
        self.dropped = 0

    def put(self, stamp: float, vector: Sequence[float] | Floats, kind: Kind) -> None:
        """Leave a sample; it is copied."""
        x, y, z = vector
        if len(self._samples) >= self._size:
            self.dropped += 1
        self._samples.append(SensorSample(float(stamp), (float(x), float(y), float(z)), kind))

    def take(self) -> SensorSample | None:
        """Take out and return the oldest sample; None when there is none."""
        try:
            return self._samples.popleft()
        except IndexError:
            return None

    def __len__(self) -> int:
        return len(self._samples)
