"""Encoders at the joints themselves, as the RAVEN-II's calibration rig has them, and their registration at the stops.

Their zero is found while the robot homes, which runs each joint into its stop. The rig's rule
[raven2_CRTK_Python_controller]: within 60 s each joint runs into its stop; zero is the mean of the counts within a
window of the farthest ones. The rig begins when it is started; here the robot's state says when it homes, or, where
nobody tells, the counts do.
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError

_BITS = (16, 24, 32)
JOINTS = ("shoulder", "elbow", "insertion")


@dataclass(frozen=True)
class EncoderRig:
    """Three encoders beside the arm's positioning joints: shoulder and elbow [rad], insertion [m].

    They are those of the calibration rig [raven2_CRTK_Python_controller]: 80,000 counts a turn, 5 um a count; its
    zero is the mean of the counts within a window of the farthest ones seen at the stops, and there it calls the
    joints 0, 130 deg and 0.572467 m. The robot calls the same stops 0, 137.5 deg, 0.562 m.
    """

    counts: ClassVar[Floats] = frozen(
        np.array([80_000 / (2.0 * np.pi), 80_000 / (2.0 * np.pi), 1.0 / 5e-6])
    )  # per rad, rad, m
    stop: ClassVar[Floats] = frozen(np.array([0.0, np.deg2rad(130.0), 0.572467]))  # [rad, rad, m]
    side: ClassVar[Floats] = frozen(np.array([-1.0, 1.0, 1.0]))  # on which the stop lies: -1 below, 1 above
    window: ClassVar[Floats] = frozen(np.array([50.0, 20.0, 20.0]))  # counts
    # [rad/s, rad/s, m/s] twice what the robot's software lets through (2.5 rad/s); five times the homing's fastest
    # insertion (0.1 m/s)
    max_speed: ClassVar[Floats] = frozen(np.array([5.0, 5.0, 0.5]))
    direction: Floats = field(default_factory=lambda: np.ones(3))  # -1: counts against its joint
    bits: int = 32  # of the board's counters; beyond their end they begin at the other

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", frozen(as_array("encoder rig direction", self.direction, (3,))))
        if not (np.abs(self.direction) == 1.0).all():
            raise InputError(f"encoder rig direction: expected 1 or -1 each, got {self.direction}")
        if self.bits not in _BITS:
            raise InputError(f"encoder rig bits: expected one of {_BITS}, got {self.bits}")

    def positions(self, counts: Floats, zero: Floats) -> Floats:
        """Return joint positions (..., 3) [rad, rad, m] of counts (..., 3); `zero` (3,) are those at the stops."""
        return self.stop + (counts - zero) / self.counts


Flags = NDArray[np.bool_]
_HOMING_S = 60.0  # [s]
# beyond its farthest by a push into the stop, cables give way and the joint creeps back by as much
_REST_COUNTS = 100.0  # counts from the farthest, within which a joint stands at its stop: 0.45 deg, 0.5 mm
_TOGETHER_S = 0.2  # [s] for which all joints stand at their stops at once: the robot waits so long to register
# [rad, rad, m] that a joint must come towards its stop; one that goes as far past it shows that it was none
_LEAST_TRAVEL = (np.deg2rad(1.0), np.deg2rad(1.0), 0.002)


class Registration:
    """Finds the counts at the stops.

    When the robot tells that it homes (`tell`), what lies between the begin and the end of it counts. When nobody
    does, all three joints must have come towards their stops, have stood at their farthest together, and have left.
    A joint that later goes past its stop shows that it was none, and the registration is void.
    """

    def __init__(self, rig: EncoderRig) -> None:
        self._rig = rig
        self.zero: Floats | None = None  # (3,) counts at the stops
        self.reason = "not registered: home the robot"  # why there is none
        self._told: bool | None = None  # whether the robot homes; None: nobody tells
        self._travel = np.array(_LEAST_TRAVEL) * rig.counts
        self._clear()

    @property
    def is_watching(self) -> bool:
        """Whether counts are being watched for the stops."""
        return self.zero is None and self._told is not False

    def _clear(self) -> None:
        self._seen: list[Floats] = []
        self._start = np.zeros(3)
        self._peak = np.zeros(3)  # farthest towards the stop, times its side
        self._anchor = np.zeros(3)  # the farthest when they began to stand together
        self._moving_since, self._together_since = math.inf, math.inf

    def lose(self, reason: str) -> None:
        """Forget the zero: counts were lost."""
        self.zero, self.reason = None, f"{reason}; not registered: home the robot again"
        self._clear()

    def tell(self, homing: bool, homed: bool) -> None:
        """Take the robot's operating state: whether it homes now, and whether it is homed."""
        was, self._told = self._told, homing
        if homing and not was:
            self.zero, self.reason = None, "not registered: the robot homes"
            self._clear()
        elif was and not homing and self.zero is None:
            travelled = len(self._seen) and (self._peak - self._start * self._rig.side > self._travel).any()
            if homed and travelled:
                self._register()
            else:
                self.reason = "not registered: homing ended without " + (
                    "the joints having moved" if homed else "the robot being homed"
                )
            self._seen.clear()

    def update(self, time: float, counts: Floats) -> None:
        """Take a good row of counts (3,), at a time [s]."""
        toward = counts * self._rig.side
        if self.zero is not None:
            past = toward - self.zero * self._rig.side > self._travel
            if past.any():
                which = ", ".join(name for name, is_past in zip(JOINTS, past, strict=True) if is_past)
                self.lose(f"{which} went past what was taken for the stop")
            return
        if self._told is False:
            return
        if not self._seen:
            self._start, self._peak = counts, toward
            self._moving_since = self._together_since = math.inf
        self._seen.append(counts)
        self._peak = np.maximum(self._peak, toward)
        came = self._peak - self._start * self._rig.side > self._travel
        if self._moving_since == math.inf:
            if np.abs(counts - self._start).max() <= _REST_COUNTS:
                del self._seen[:-1]  # it has not begun; what was before is of no use
                self._peak = toward
                return
            self._moving_since = time
        if self._told is None and self._has_left(time, toward, came):
            self._register()
        elif time - self._moving_since > _HOMING_S:
            absent = [name for name, moved in zip(JOINTS, came, strict=True) if not moved]
            why = f"{', '.join(absent)} did not come to a stop" if absent else "the stops were not left"
            self._clear()
            self.reason = f"not registered: {why} within {_HOMING_S:g} s; home the robot"

    def _has_left(self, time: float, toward: Floats, came: Flags) -> bool:
        """Return whether all joints stood at their farthest together, and one has left."""
        if came.all() and (self._peak - toward <= _REST_COUNTS).all():
            # where one still goes on towards its stop, nobody stands yet
            if self._together_since == math.inf or (self._peak - self._anchor > _REST_COUNTS).any():
                self._together_since, self._anchor = time, self._peak
            return False
        stood = time - self._together_since >= _TOGETHER_S
        self._together_since = math.inf
        return stood

    def _register(self) -> None:
        """Take the mean of the counts within a window of the farthest for zero."""
        seen, side = np.array(self._seen), self._rig.side
        near = self._peak - seen * side <= self._rig.window
        self.zero = frozen(np.where(near, seen, 0.0).sum(axis=0) / near.sum(axis=0))
        self.reason = ""
        self._clear()
