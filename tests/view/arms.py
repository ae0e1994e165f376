"""States for tests of the view."""

import numpy as np

from catenary.monitor import Snapshot
from catenary.robots.catalog import load_robot

RAVEN = load_robot("raven2")
Q = np.array([0.7, 1.5, 0.4])


def state(time: float = 0.0, **known: object) -> Snapshot:
    """A RAVEN-II at Q, of which more may be known."""
    return Snapshot(time, RAVEN.joint_names, RAVEN.joint_units, Q)._replace(**known)
