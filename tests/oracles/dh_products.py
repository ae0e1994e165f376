"""The matrices of both Denavit-Hartenberg conventions, written out."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def modified(alpha: float, a: float, d: float, theta: float) -> Floats:
    """Craig, Introduction to Robotics, eq. 3.6."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array([[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]])


def standard(alpha: float, a: float, d: float, theta: float) -> Floats:
    """Denavit and Hartenberg's, as in Spong, Robot Modeling and Control, eq. 3.10."""
    ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
    return np.array([[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]])


PRODUCTS = {"modified": modified, "standard": standard}
