"""Whether a motion keeps bodies apart at every instant, not only where it was looked at.

Two bodies that are d apart at one instant cannot meet before their points have moved d against each other. Between two
instants h apart, with distances d1 and d2 at them and points no faster than v against each other, the distance stays
above (d1 + d2 - v h) / 2 (conservative advancement: Mirtich 1996, "Impulse-based dynamic simulation of rigid body
systems", section 2.3). An interval for which that is less than the margin is halved, pair by pair, until it is proven
or a distance falls below the margin.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.collision.scene import CollisionScene, Names, PlacedBodies

FIRST = 128  # intervals that a motion is cut into before any is halved
FINEST = 2e-5  # [m] of motion in an interval: closer to the margin than this counts as within it


class JointPath(Protocol):
    """A motion that can be asked for any instant."""

    @property
    def duration(self) -> float:
        """[s]."""

    @property
    def acceleration_bound(self) -> Floats:
        """(n,) no joint's acceleration exceeds it at any instant [rad/s2 or m/s2]."""

    def sample(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return q, qd, qdd, each (N, n), at times (N,) [s]."""


@dataclass(frozen=True)
class Clearance:
    """What is known of the distances along a motion."""

    is_kept: bool  # the margin, at every instant
    pair: Names  # closest to each other where looked at
    time: float  # [s] when
    distance: float  # [m] their distance then
    instants: int  # that were looked at


@dataclass
class _Looks:
    scene: CollisionScene
    margin: float
    times: Floats
    placed: PlacedBodies
    speeds: Floats
    known: Floats  # (instants, pairs) distances, or what they are at least
    is_true: NDArray[np.bool_]
    closest: tuple[float, float, int] = field(default=(np.inf, 0.0, 0))  # distance, time, pair

    def see(self, rows: NDArray[np.int64], pairs: NDArray[np.int64]) -> bool:
        """Measure what is not yet; return whether a distance is within the margin. The most doubtful come first."""
        doubtful = np.flatnonzero(~self.is_true[rows, pairs])
        for k in doubtful[np.argsort(self.known[rows[doubtful], pairs[doubtful]])]:
            row, pair = int(rows[k]), int(pairs[k])
            if self.is_true[row, pair]:
                continue
            # the lower bound stays one: rounding of Coal's must not undercut it
            found = max(self.known[row, pair], self.scene.distance(self.placed, row, pair, self.margin))
            self.known[row, pair], self.is_true[row, pair] = found, True
            if found < self.margin:
                self.closest = found, float(self.times[row]), pair
                return True
        return False


def clearance_of(scene: CollisionScene, path: JointPath, margin: float) -> Clearance:
    """Return whether all pairs of a scene stay farther apart than a margin [m] at every instant of a motion."""
    times = np.linspace(0.0, path.duration, FIRST + 1)
    search = _look(scene, path, margin, times)
    count = len(scene.pairs)
    left = np.repeat(np.arange(FIRST), count)
    pairs = np.tile(np.arange(count), FIRST)
    open_ = left, left + 1, pairs
    bound, reach = path.acceleration_bound, scene.reach
    instants = 0
    while True:
        open_, within = _unproven(search, open_, bound, reach)
        instants += len(search.times)
        if within or not len(open_[0]):
            found = search.closest if within else _nearest(scene, path, times)
            return Clearance(not within, scene.names(found[2]), found[1], found[0], instants)
        search, open_ = _halved(search, path, open_)


def _look(scene: CollisionScene, path: JointPath, margin: float, times: Floats) -> _Looks:
    q, qd, _ = path.sample(times)
    placed = scene.place(q)
    known = scene.lower_bounds(placed)
    return _Looks(scene, margin, times, placed, np.abs(qd), known, np.tile(scene.is_exact, (len(times), 1)))


Intervals = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]  # rows at both ends, pairs


def _unproven(search: _Looks, open_: Intervals, bound: Floats, reach: Floats) -> tuple[Intervals, bool]:
    """Return the intervals that stay unproven, and whether a distance was found within the margin."""
    left, right, pairs = open_
    h = search.times[right] - search.times[left]
    fastest = np.maximum(search.speeds[left], search.speeds[right]) + 0.5 * h[:, None] * bound
    moved = h * np.einsum("kn,kn->k", fastest, reach[pairs])

    def is_doubtful(k: NDArray[np.int64]) -> NDArray[np.bool_]:
        ends = search.known[left[k], pairs[k]] + search.known[right[k], pairs[k]]
        return np.asarray(0.5 * (ends - moved[k]) < search.margin)

    k = np.flatnonzero(is_doubtful(np.arange(len(left))))
    # a true distance within the margin decides
    for rows in (left[k], right[k]):
        bad = search.is_true[rows, pairs[k]] & (search.known[rows, pairs[k]] < search.margin)
        if bad.any():
            where = int(np.flatnonzero(bad)[np.argmin(search.known[rows[bad], pairs[k][bad]])])
            row, pair = int(rows[where]), int(pairs[k][where])
            search.closest = float(search.known[row, pair]), float(search.times[row]), pair
            return open_, True
    if search.see(np.concatenate([left[k], right[k]]), np.concatenate([pairs[k], pairs[k]])):
        return open_, True
    k = k[is_doubtful(k)]
    stuck = k[moved[k] < FINEST]
    if len(stuck):
        row, pair = int(left[stuck[0]]), int(pairs[stuck[0]])
        search.closest = float(search.known[row, pair]), float(search.times[row]), pair
        return open_, True
    return (left[k], right[k], pairs[k]), False


def _halved(search: _Looks, path: JointPath, open_: Intervals) -> tuple[_Looks, Intervals]:
    """Return the halves of intervals, and the search that holds their three instants."""
    left, right, pairs = open_
    middle = 0.5 * (search.times[left] + search.times[right])
    times, place = np.unique(middle, return_inverse=True)
    new = _look(search.scene, path, search.margin, times)
    kept, where = np.unique(np.concatenate([left, right]), return_inverse=True)
    old_left, old_right = np.split(where, 2)
    joined = _Looks(
        search.scene,
        search.margin,
        np.concatenate([search.times[kept], new.times]),
        PlacedBodies(
            np.concatenate([search.placed.rotations[kept], new.placed.rotations]),
            np.concatenate([search.placed.positions[kept], new.placed.positions]),
        ),
        np.concatenate([search.speeds[kept], new.speeds]),
        np.concatenate([search.known[kept], new.known]),
        np.concatenate([search.is_true[kept], new.is_true]),
    )
    mid = len(kept) + place
    return joined, (np.concatenate([old_left, mid]), np.concatenate([mid, old_right]), np.concatenate([pairs, pairs]))


def _nearest(scene: CollisionScene, path: JointPath, times: Floats) -> tuple[float, float, int]:
    """Return the smallest distance of a motion at some instants, when it is, and of which pair."""
    placed = scene.place(path.sample(times)[0])
    known = scene.lower_bounds(placed)
    best: tuple[float, float, int] = (np.inf, 0.0, 0)
    for place in np.argsort(known, axis=None):
        row, pair = (int(k) for k in np.unravel_index(int(place), known.shape))
        if known[row, pair] >= best[0]:
            break
        apart = float(known[row, pair])
        if not scene.is_exact[pair]:
            apart = scene.distance(placed, row, pair, best[0])
        best = min(best, (apart, float(times[row]), pair))
    return best
