"""Smooth functions of features: powers, waves, saturation and products, as arithmetic of a tick.

A feature counts as z = (x - middle) / scale. Of a position z: z^2 and z^3, and waves cos(k pi / 2 (z + 1)) over its
range of training, for what drums and pulleys do; of an angle q also sin k q and cos k q. Of a torque or current t:
tanh t and |t|, as loads saturate and change sides. Of pairs of features their product. Outside of training z is held at
`limit` in all but its linear term, so that what the data did not show does not grow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.cards import StoredFloats, StoredIntegers
from catenary.errors import InputError
from catenary.kernels.bind import Step, run
from catenary.kernels.compiled import compiled, inlined
from catenary.kernels.row_functions import exp_minus_1, within

TURNS = 3  # multiples of an angle
_FIRST_WAVE, LAST_WAVE = 4, 12  # half periods over the range: longer waves are as good as powers
POWERS, WAVES, SATURATIONS = 2, LAST_WAVE - _FIRST_WAVE + 1, 2  # columns of a position, again, and of a load
DROPPED = 1e9  # rows, as all penalties: a group of terms is left out
_HALF_PI, _TWO_PI = 1.5707963267948966, 6.283185307179586


@dataclass(frozen=True)
class Terms:
    """Which terms a linear function has, of F features: C columns in the order of `term_owners`."""

    middle: StoredFloats  # (F,)
    scale: StoredFloats  # (F,)
    limit: StoredFloats  # (F,)
    positions: StoredIntegers  # features with powers and waves
    angles: StoredIntegers  # features with multiples of an angle
    loads: StoredIntegers  # features with saturation
    pairs: StoredIntegers  # (P, 2) features whose products are taken

    def __post_init__(self) -> None:
        width, indices = len(self.middle), (self.positions, self.angles, self.loads, self.pairs)
        for name in ("middle", "scale", "limit"):
            if np.shape(getattr(self, name)) != (width,):
                raise InputError(f"terms: expected {width} numbers as {name}, got {np.shape(getattr(self, name))}")
        for name, values in zip(("positions", "angles", "loads", "pairs"), indices, strict=True):
            flat = np.asarray(values)
            is_index = flat.dtype.kind in "iu" and (flat.size == 0 or (flat.min() >= 0 and flat.max() < width))
            if not is_index or flat.shape[1:] != ((2,) if name == "pairs" else ()):
                raise InputError(f"terms: {name}: expected indices of {width} features, got {flat.tolist()}")
            object.__setattr__(self, name, np.array(flat, dtype=np.int64, order="C"))

    @classmethod
    def plain(cls, middle: Floats, scale: Floats, pairs: Integers | None = None) -> Self:
        """Return those of a linear function or, with pairs (P, 2), of a polynomial: unlimited, without functions."""
        none = np.zeros(0, dtype=np.int64)
        pairs = np.zeros((0, 2), dtype=np.int64) if pairs is None else pairs
        return cls(middle, scale, np.full(len(middle), ANY_SIZE), none, none, none, pairs)

    def __len__(self) -> int:
        of_positions = (POWERS + WAVES) * len(self.positions) + 2 * TURNS * len(self.angles)
        return len(self.middle) + of_positions + SATURATIONS * len(self.loads) + len(self.pairs)

    def taking(self, features: Flags) -> Flags:
        """Return flags (C,) of the terms that flagged features (F,) enter: themselves, or products with them."""
        others = len(self) - len(features) - len(self.pairs)
        return np.concatenate([features, np.zeros(others, dtype=bool), features[self.pairs].any(axis=1)])

    def step(self, X: Floats, Z: Floats) -> Step:
        """Return the compiled step that writes the terms Z (N, C) of features X (N, F)."""
        features = (self.middle, self.scale, self.limit, self.positions, self.angles, self.loads, self.pairs)
        return Step(expand, (X, *features), (Z,))

    def of(self, X: Floats) -> Floats:
        """Return the terms (N, C) of features X (N, F)."""
        Z = np.empty((len(X), len(self)))
        run([self.step(np.ascontiguousarray(X), Z)])
        return Z


@inlined
def sine(a: float) -> float:
    """Return sin(a) for |a| <= pi, to 1e-15: Taylor's series of a third, then sin 3b = 3 sin b - 4 sin^3 b."""
    b = a / 3.0
    s = b * b
    t = 1.0 / 6227020800.0 - s * (1.0 / 1307674368000.0 - s * (1.0 / 355687428096000.0))
    t = 1.0 / 362880.0 - s * (1.0 / 39916800.0 - s * t)
    t = b * (1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s * t))))
    return t * (3.0 - 4.0 * t * t)


@inlined
def reduced(a: float) -> float:
    """Return an angle within a turn about zero, a + 2 pi k; of at most 1e6 turns."""
    turns = within(a / _TWO_PI, 1e6)
    nearest = int(turns + 0.5) if turns > 0.0 else int(turns - 0.5)
    return within(a - nearest * _TWO_PI, 2.0 * _HALF_PI)


@compiled
def expand(
    X: Floats,  # (N, F)
    middle: Floats,  # (F,) these and the following are those of `Terms`
    scale: Floats,
    limit: Floats,
    positions: Integers,
    angles: Integers,
    loads: Integers,
    pairs: Integers,
    Z: Floats,  # (N, C) receives the terms
) -> None:
    """Write the terms of rows of features."""
    for row in range(len(X)):
        at = X.shape[1]
        for k in range(at):
            Z[row, k] = (X[row, k] - middle[k]) / scale[k]
        for k in range(len(positions)):
            z = within(Z[row, positions[k]], limit[positions[k]])
            Z[row, at], Z[row, at + 1] = z * z, z * z * z
            at += 2
            now = -sine(_HALF_PI * z)  # cos(pi / 2 (z + 1))
            twice, before = 2.0 * now, 1.0
            for wave in range(2, LAST_WAVE + 1):
                later = twice * now - before  # cos(n + 1) a = 2 cos a cos n a - cos(n - 1) a
                before = now
                now = later
                if wave >= _FIRST_WAVE:
                    Z[row, at] = now
                    at += 1
        for k in range(len(angles)):
            j = angles[k]
            a = reduced(middle[j] + scale[j] * within(Z[row, j], limit[j]))
            half, quarter = sine(0.5 * a), sine(0.5 * (2.0 * _HALF_PI - abs(a)))  # sin a / 2 and cos a / 2
            s1, c1 = 2.0 * half * quarter, 1.0 - 2.0 * half * half
            s2, c2 = 2.0 * s1 * c1, 1.0 - 2.0 * s1 * s1
            Z[row, at], Z[row, at + 1], Z[row, at + 2], Z[row, at + 3] = s1, c1, s2, c2
            Z[row, at + 4], Z[row, at + 5] = s1 * c2 + c1 * s2, c1 * c2 - s1 * s2
            at += 6
        for k in range(len(loads)):
            t = within(Z[row, loads[k]], limit[loads[k]])
            e = exp_minus_1(2.0 * t)
            Z[row, at], Z[row, at + 1] = e / (e + 2.0), abs(t)
            at += 2
        for k in range(len(pairs)):
            a = within(Z[row, pairs[k, 0]], limit[pairs[k, 0]])
            Z[row, at] = a * within(Z[row, pairs[k, 1]], limit[pairs[k, 1]])
            at += 1


def term_owners(terms: Terms, joints: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the kind of term and the joint of each column; `joints` (F,) are the features'."""
    is_signal = set(range(len(joints)))
    kinds = ["feature"] * len(is_signal)
    owners = list(joints)
    for j in terms.positions.tolist():
        kinds += ["smooth"] * POWERS + ["ripple"] * WAVES
        owners += [joints[j]] * (POWERS + WAVES)
    for j in terms.angles.tolist():
        kinds += ["smooth"] * 2 * TURNS
        owners += [joints[j]] * 2 * TURNS
    for j in terms.loads.tolist():
        kinds += ["smooth"] * SATURATIONS
        owners += [joints[j]] * SATURATIONS
    kinds += ["product"] * len(terms.pairs)
    owners += [joints[j] for j in terms.pairs[:, 0].tolist()]
    return kinds, owners
