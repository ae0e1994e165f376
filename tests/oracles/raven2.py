"""RAVEN-II by its Denavit-Hartenberg table, multiplied out matrix by matrix.

Table: uw-biorobotics/raven2 @ d2307c5, modified convention, Rx(alpha) Tx(a) Rz(theta) Tz(d).
"""

import numpy as np
from numpy.typing import NDArray

from oracles.dh_products import modified

Floats = NDArray[np.float64]

# alpha, theta offset [deg] of the first three rows; the other rows are alike on both arms
_ALPHA = {"left": (0, 75, 128), "right": (180, 75, 52)}
_THETA = {"left": (205, 180, 90), "right": (25, 0, -90)}

MASS = (0.494, 0.750, 0.231)  # kg


def dh_frames(arm: str, joints: Floats) -> list[Floats]:
    """Homogeneous transforms T_0_i (4, 4) for three or six joints [rad, rad, m, rad, rad, rad]."""
    J = np.concatenate([joints, np.zeros(6 - len(joints))])
    alpha, theta = _ALPHA[arm], _THETA[arm]
    rows = [
        (alpha[0], 0.0, np.deg2rad(theta[0]) + J[0], 0.0),
        (alpha[1], 0.0, np.deg2rad(theta[1]) + J[1], 0.0),
        (alpha[2], 0.0, np.deg2rad(theta[2]), J[2]),
        (0, 0.0, J[3], -0.47),
        (90, 0.0, J[4] - np.pi / 2, 0.0),
        (90, 0.013, J[5], 0.0),
    ]
    frames = []
    T = np.eye(4)
    for alpha_deg, a, angle, d in rows:
        T = T @ modified(np.deg2rad(alpha_deg), a, d, angle)
        frames.append(T)
    return frames
