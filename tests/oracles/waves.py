"""Three joints of a RAVEN-II along sines."""

import numpy as np

from catenary.trajectories.reference import SampledTrajectory

START = (0.52, 1.57, 0.4)  # [rad, rad, m]
SIZE, RATE = np.array([0.1, 0.15, 0.01]), np.array([0.9, 1.3, 0.7])


class Waves(SampledTrajectory):
    """Sines about a start."""

    def __init__(self, duration: float, start=START, *, larger: float = 1.0) -> None:
        self.duration, self.start, self.size = duration, np.array(start), larger * SIZE

    def sample(self, times):
        t = np.clip(np.asarray(times, dtype=float), 0.0, self.duration)[:, np.newaxis]
        s, c = np.sin(RATE * t), np.cos(RATE * t)
        return self.start + self.size * s, self.size * RATE * c, -self.size * RATE**2 * s
