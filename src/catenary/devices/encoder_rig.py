"""Encoders at the joints themselves, as the RAVEN-II's calibration rig has them, and their registration at the stops.

Their zero is found while the robot homes, which runs each joint into its stop. The rig's rule
[raven2_CRTK_Python_controller]: within 60 s each joint runs into its stop; zero is the mean of the counts within a
window of the farthest ones. The rig begins when it is started; here the robot's state says when it homes.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

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


# [rad, rad, m] that a joint must come towards its stop; one that goes as far past it shows that it was none
_LEAST_TRAVEL = (np.deg2rad(1.0), np.deg2rad(1.0), 0.002)


class Registration:
    """Finds the counts at the stops among those that come while the robot homes, by its own word (`tell`).

    A joint that later goes past its stop shows that it was none, and the registration is void.
    """

    def __init__(self, rig: EncoderRig) -> None:
        self._rig = rig
        self.zero: Floats | None = None  # (3,) counts at the stops
        self.reason = "not registered: home the robot"  # why there is none
        self.is_watching = False  # the robot homes
        self._travel = np.array(_LEAST_TRAVEL) * rig.counts
        self._seen: list[Floats] = []

    def lose(self, reason: str) -> None:
        """Forget the zero: counts were lost."""
        self.zero, self.reason = None, f"{reason}; not registered: home the robot again"
        self._seen.clear()

    def tell(self, homing: bool, homed: bool) -> None:
        """Take the robot's operating state: whether it homes now, and whether it is homed."""
        was, self.is_watching = self.is_watching, homing
        if homing and not was:
            self.zero, self.reason = None, "not registered: the robot homes"
            self._seen.clear()
        elif was and not homing:
            self._register(homed)
            self._seen.clear()

    def update(self, counts: Floats) -> None:
        """Take a good row of counts (3,)."""
        if self.zero is not None:
            past = (counts - self.zero) * self._rig.side > self._travel
            if past.any():
                which = ", ".join(name for name, is_past in zip(JOINTS, past, strict=True) if is_past)
                self.lose(f"{which} went past what was taken for the stop")
        elif self.is_watching:
            self._seen.append(counts)

    def _register(self, homed: bool) -> None:
        """Take the mean of the counts within a window of the farthest for zero."""
        toward = np.array(self._seen).reshape(-1, 3) * self._rig.side
        travelled = len(toward) and (toward.max(axis=0) - toward[0] > self._travel).any()
        if not (homed and travelled):
            without = "the joints having moved" if homed else "the robot being homed"
            self.reason = f"not registered: homing ended without {without}"
            return
        near = toward.max(axis=0) - toward <= self._rig.window
        self.zero = frozen(self._rig.side * np.where(near, toward, 0.0).sum(axis=0) / near.sum(axis=0))
        self.reason = ""
