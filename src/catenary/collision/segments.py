"""Distances between segments, for many pairs at once: what capsules are as far apart as, less their radii."""

import numpy as np

from catenary.arrays import Floats

_POINT = 1e-18  # [m2] square of a length of nothing


def segment_distance(p0: Floats, p1: Floats, q0: Floats, q1: Floats) -> Floats:
    """Return the distances (...) between segments p0 p1 and q0 q1, ends (..., 3) [m].

    The closest points of the lines, clamped to the segments, one after the other. [Ericson, Real-Time Collision
    Detection, 2005, section 5.1.9]
    """
    d1, d2, r = p1 - p0, q1 - q0, p0 - q0
    a, e, b = _dot(d1, d1), _dot(d2, d2), _dot(d1, d2)
    c, f = _dot(d1, r), _dot(d2, r)
    safe_a, safe_e = np.where(a > _POINT, a, 1.0), np.where(e > _POINT, e, 1.0)
    denominator = a * e - b * b
    lines = denominator > 1e-12 * np.maximum(a * e, _POINT)  # parallel ones: any point of the first will do
    s = np.clip(np.where(lines, (b * f - c * e) / np.where(lines, denominator, 1.0), 0.0), 0.0, 1.0)
    s = np.where(e > _POINT, s, np.clip(-c / safe_a, 0.0, 1.0))
    t = np.where(e > _POINT, (b * s + f) / safe_e, 0.0)
    clamped = np.clip(t, 0.0, 1.0)
    s = np.where(t != clamped, np.clip((b * clamped - c) / safe_a, 0.0, 1.0), s)
    s = np.where(a > _POINT, s, 0.0)
    clamped = np.where(a > _POINT, clamped, np.where(e > _POINT, np.clip(f / safe_e, 0.0, 1.0), 0.0))
    apart = r + s[..., None] * d1 - clamped[..., None] * d2
    return np.asarray(np.sqrt(_dot(apart, apart)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))
