"""Bodies as clouds of point masses, whose mass, centre and inertia are sums."""

import numpy as np
from numpy.testing import assert_allclose

from catenary.robots.link_inertia import LinkInertia


def cloud(rng, count=20):
    """Point masses: masses (N,) [kg], places (N, 3) [m]."""
    return rng.uniform(0.1, 1.0, count), rng.normal(size=(count, 3))


def inertia_of(masses, places):
    com = masses @ places / masses.sum()
    arms = places - com
    tensor = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
    return LinkInertia(float(masses.sum()), com, tensor)


def assert_same_body(a, b):
    assert_allclose(a.mass, b.mass, rtol=1e-12)
    assert_allclose(a.com, b.com, atol=1e-10)  # sums over tens of point masses
    assert_allclose(a.inertia, b.inertia, atol=1e-9)
