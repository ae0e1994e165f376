"""Loads of every kind beside the links' own."""

import numpy as np

from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    Spring,
    actuation_terms,
)


def every_load(n: int, rng: np.random.Generator, *, loaded: bool = False, smooth: float = 0.05) -> ActuationLoads:
    """Draw two effects of every kind, on one of n coordinates and on a combination of all.

    Args:
        n, rng: Number of coordinates; source of randomness.
        loaded: Whether friction depends on the load.
        smooth: Speed below which Coulomb friction is smoothed [rad/s].
    """
    one, mixed = np.eye(n)[rng.integers(n)], rng.normal(size=n)
    actuation = Actuation(
        friction=(
            Friction("one", one, asymmetric=True, stribeck=0.3, load=loaded, presliding=0.01),
            Friction("mixed */ x", mixed, offset=False, load=loaded),
        ),
        motor_inertia=(MotorInertia("one", one), MotorInertia("mixed", mixed)),
        springs=(Spring("linear", mixed), Spring("lever", one, LeverSpring(0.01, 0.1, 0.06, float(rng.normal())))),
        known_torques=(KnownTorque("cable", one, mixed, rng.normal(size=4)),),
        coulomb_velocity=smooth,
    )
    terms = actuation_terms(actuation)
    return ActuationLoads(n, actuation, terms, rng.uniform(0.1, 0.5, len(terms)))
