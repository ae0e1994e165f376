"""The whole history of a recorded motion, of which friction needs more than the row at hand.

Torques are filtered, so a step of Coulomb friction that they hold is rounded: the column it is fitted with passes the
same filter. Presliding friction depends on the path since the last reversals. Both are computed over the whole
recording before rows are left out.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import term_load
from catenary.kernels.compiled import compiled
from catenary.robots.actuation import ActuationTerm

STEPS = ("coulomb", "stribeck", "load")  # kinds that leap where the rate changes sign


@dataclass(frozen=True, eq=False)
class FrictionHistory:
    """A recording's filtered positions and velocities, of which some rows were kept."""

    segments: tuple[tuple[Floats, Floats], ...]  # q, qd (M, n) of every stretch in which time goes on
    cut: int  # rows left out at either end of a stretch
    sections: Floats  # of the filter, second-order
    kept: NDArray[np.int64]  # rows that are left, counted after the cut

    def rows(self, which: NDArray[np.bool_]) -> "FrictionHistory":
        """Return the history with fewer rows kept."""
        return replace(self, kept=self.kept[which])

    def remembers(self, term: ActuationTerm) -> bool:
        """Return whether a term's column is computed here."""
        return term.kind in STEPS or term.kind == "presliding"

    def load(self, term: ActuationTerm, coulomb_velocity: float) -> Floats:
        """Return a term's load (N,) on the rows kept, per unit; that of load-dependent friction per Nm or N carried."""
        from scipy.signal import sosfiltfilt

        parts = []
        for q, qd in self.segments:
            if term.kind == "presliding":
                load = presliding(q @ term.combination, term.scale)
            else:
                step = term._replace(kind="coulomb") if term.kind == "load" else term
                load = sosfiltfilt(self.sections, term_load(step, q, qd, qd, coulomb_velocity))
            parts.append(load[self.cut : len(load) - self.cut])
        whole: Floats = np.concatenate(parts)[self.kept]
        return whole


def presliding(s: Floats, distance: float) -> Floats:
    """Return Dahl's friction z (N,) along a path s, between -1 and 1: dz = ds - |ds| z / distance, in its units.

    It depends on the path alone, not on time. It begins at zero, as after a rest.
    """
    out = np.empty(len(s))
    _presliding_rows(np.ascontiguousarray(s), distance, out)
    return out


@compiled
def _presliding_rows(s: Floats, distance: float, out: Floats) -> None:
    z = 0.0
    out[0] = z
    for k in range(1, len(s)):
        step = s[k] - s[k - 1]
        # exact while the direction stays: z goes to the direction's sign as exp(-|ds| / distance)
        towards = 1.0 if step > 0.0 else -1.0
        z = towards + (z - towards) * np.exp(-abs(step) / distance)
        out[k] = z
