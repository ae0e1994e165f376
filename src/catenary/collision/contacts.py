"""Which pairs touch at given configurations, and which touch wherever the robot goes."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.collision.scene import CollisionScene, Names
from catenary.errors import InputError

POSES = 60  # at which it is looked for pairs that always touch, and for a pose where nothing does


def touching(scene: CollisionScene, q: Floats, margin: float) -> NDArray[np.bool_]:
    """Return which pairs (N, P) are closer than a margin [m] at configurations (N, n)."""
    placed = scene.place(q)
    known = scene.lower_bounds(placed)
    close = known < margin
    for row, pair in np.argwhere(close & ~scene.is_exact):
        close[row, pair] = scene.distance(placed, int(row), int(pair), margin) < margin
    return np.asarray(close)


def is_free(scene: CollisionScene, q: Floats, margin: float) -> NDArray[np.bool_]:
    """Return at which configurations (N, n) no pair is closer than a margin [m]; the likeliest pairs come first."""
    placed = scene.place(q)
    known = scene.lower_bounds(placed)
    free: NDArray[np.bool_] = np.asarray(~(known[:, scene.is_exact] < margin).any(axis=1))
    close = np.argwhere((known < margin) & ~scene.is_exact & free[:, None])
    for row, pair in close[np.argsort(known[close[:, 0], close[:, 1]])]:
        if free[row]:
            free[row] = scene.distance(placed, int(row), int(pair), margin) >= margin
    return np.asarray(free)


def without_constant_contacts(
    scene: CollisionScene, q: Floats, margin: float
) -> tuple[CollisionScene, tuple[Names, ...]]:
    """Return a scene without the pairs of links that are within the margin at all configurations (N, n), and these.

    Links that touch in every pose do so by their make, or by the coarseness of their shapes; they say nothing about
    where the robot may go. Pairs with obstacles always stay.
    """
    always = touching(scene, q, margin).all(axis=0)
    always &= ~np.array([any(scene.bodies[b].is_obstacle for b in pair) for pair in scene.pairs])
    names = tuple(dict.fromkeys(scene.names(int(k)) for k in np.flatnonzero(always)))
    if not names:
        return scene, ()
    if always.all():
        raise InputError(
            f'robot "{scene.model.name}": every pair of its bodies is within {1000 * margin:g} mm in all of {len(q)} '
            "poses: a smaller margin, or smaller shapes?"
        )
    return replace(scene, pairs=scene.pairs[~always], _tools={}), names


def require_free_pose(scene: CollisionScene, q: Floats, margin: float) -> Floats:
    """Return which of configurations (N, n) are free, (M, n); at least one is."""
    close = touching(scene, q, margin)
    free = ~close.any(axis=1)
    if free.any():
        return q[free]
    often = np.argsort(-close.sum(axis=0), kind="stable")[:3]
    told = ", ".join(
        f"{a} and {b} in {100 * close[:, k].mean():.0f} %" for k in often for a, b in [scene.names(int(k))]
    )
    raise InputError(
        f'robot "{scene.model.name}": in none of {len(q)} poses within the limits does everything keep '
        f"{1000 * margin:g} mm apart; within it are {told}"
    )


def keep_apart(scene: CollisionScene, q: Floats, margin: float) -> bool:
    """Return whether no pair is closer than a margin [m] at any of configurations (N, n); the likeliest come first."""
    placed = scene.place(q)
    known = scene.lower_bounds(placed)
    if (known[:, scene.is_exact] < margin).any():
        return False
    close = np.argwhere((known < margin) & ~scene.is_exact)
    order = np.argsort(known[close[:, 0], close[:, 1]])
    return all(scene.distance(placed, int(row), int(pair), margin) >= margin for row, pair in close[order])
