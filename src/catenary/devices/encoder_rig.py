"""Encoders at the joints themselves, as the RAVEN-II's calibration rig has them: their scale, stops and limits."""

from dataclasses import dataclass, field

import numpy as np

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError

BITS = (16, 24, 32)
JOINTS = ("shoulder", "elbow", "insertion")


# by default: per rad, rad, m; [rad, rad, m]; below, above, above; counts
_COUNTS = frozen(np.array([80_000 / (2.0 * np.pi), 80_000 / (2.0 * np.pi), 1.0 / 5e-6]))
_STOP = frozen(np.array([0.0, np.deg2rad(130.0), 0.572467]))
_SIDE, _WINDOW = frozen(np.array([-1.0, 1.0, 1.0])), frozen(np.array([50.0, 20.0, 20.0]))
# twice what the robot's software lets through (2.5 rad/s); five times the homing's fastest insertion (0.1 m/s)
_MAX_SPEED = frozen(np.array([5.0, 5.0, 0.5]))


@dataclass(frozen=True)
class EncoderRig:
    """Three encoders beside the arm's positioning joints: shoulder and elbow [rad], insertion [m].

    The defaults are of the calibration rig [raven2_CRTK_Python_controller]: 80,000 counts a turn, 5 um a count; its
    zero is the mean of the counts within a window of the farthest ones seen at the stops, and there it calls the
    joints 0, 130 deg and 0.572467 m. The robot calls the same stops 0, 137.5 deg, 0.562 m.
    """

    counts: Floats = field(default_factory=lambda: _COUNTS)  # per rad, rad, m
    stop: Floats = field(default_factory=lambda: _STOP)  # [rad, rad, m]
    side: Floats = field(default_factory=lambda: _SIDE)  # on which the stop lies: -1 below, 1 above
    window: Floats = field(default_factory=lambda: _WINDOW)  # counts
    direction: Floats = field(default_factory=lambda: np.ones(3))  # -1: counts against its joint
    max_speed: Floats = field(default_factory=lambda: _MAX_SPEED)  # [rad/s, rad/s, m/s]
    bits: int = 32  # of the board's counters; beyond their end they begin at the other

    def __post_init__(self) -> None:
        for name in ("counts", "stop", "side", "window", "direction", "max_speed"):
            object.__setattr__(self, name, frozen(as_array(f"encoder rig {name}", getattr(self, name), (3,))))
        for name in ("counts", "window", "max_speed"):
            if not (getattr(self, name) > 0.0).all():
                raise InputError(f"encoder rig {name}: expected more than 0, got {getattr(self, name)}")
        for name in ("side", "direction"):
            if not (np.abs(getattr(self, name)) == 1.0).all():
                raise InputError(f"encoder rig {name}: expected 1 or -1 each, got {getattr(self, name)}")
        if self.bits not in BITS:
            raise InputError(f"encoder rig bits: expected one of {BITS}, got {self.bits}")

    def positions(self, counts: Floats, zero: Floats) -> Floats:
        """Return joint positions (..., 3) [rad, rad, m] of counts (..., 3); `zero` (3,) are those at the stops."""
        positions: Floats = self.stop + (counts - zero) / self.counts
        return positions
