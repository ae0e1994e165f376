"""States for tests of the view."""

import numpy as np

from catenary.robots.catalog import load_robot
from catenary.view.state import ViewState, unknown_state

RAVEN = load_robot("raven2")
Q = np.array([0.7, 1.5, 0.4])


def state(time: float = 0.0, **known: object) -> ViewState:
    """A RAVEN-II at Q, of which more may be known."""
    return unknown_state(3)._replace(time=time, q=Q, **known)
