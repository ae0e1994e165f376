"""The rig's encoders on the positioning joints: what they count, and how the stops register them."""

import numpy as np

from catenary.arrays import Floats
from catenary.simulation.cable_parameters import Rig


class ExternalEncoders:
    """Encoders that see the joints themselves, beyond the cables."""

    def __init__(self, rig: Rig) -> None:
        """Take the rig's numbers; the encoders are not registered."""
        self.rig = rig
        self.zero = np.full(3, np.nan)  # (3,) counts at which a joint is where `rig.registered` says
        self._seen: list[Floats] | None = None

    def counts(self, q: Floats) -> Floats:
        """Return the counts at true joint positions (..., 3) [rad, rad, m]."""
        return np.round(q * self.rig.counts)

    def positions(self, counts: Floats) -> Floats:
        """Return the joint positions that the rig reports, (..., 3) [rad, rad, m]; NaN before it is registered."""
        positions: Floats = self.rig.registered + (counts - self.zero) / self.rig.counts
        return positions

    def watch_for_stops(self) -> None:
        """Keep all counts from now on, for `register`."""
        self._seen = []

    def see(self, q: Floats) -> None:
        """Keep the counts at true joint positions (3,), while watching."""
        if self._seen is not None:
            self._seen.append(self.counts(q))

    def stop_watching(self) -> None:
        """Forget what was seen."""
        self._seen = None

    def register(self, stop_side: Floats) -> None:
        """Register each joint at its stop: the mean of the counts within a window of their peak.

        Args:
            stop_side: (3,) -1 for a stop below, 1 above.
        """
        if self._seen:
            self.zero = mean_near_peak(np.array(self._seen), stop_side, self.rig.window)
        self._seen = None


def mean_near_peak(counts: Floats, side: Floats, window: Floats) -> Floats:
    """Return the mean (3,) of the counts (T, 3) within a window (3,) of their peaks on the given sides (3,)."""
    peak = np.max(counts * side, axis=0) * side
    near = np.abs(counts - peak) <= window
    mean: Floats = np.where(near, counts, 0.0).sum(axis=0) / near.sum(axis=0)
    return mean
