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


class Advancing(Waves):
    """The same, whose slide goes on and on: where it is tells when it was there."""

    FROM, TO = 0.37, 0.43  # [m]

    def __init__(self, duration: float) -> None:
        super().__init__(duration, larger=2.0)

    def sample(self, times):
        q, qd, qdd = super().sample(times)
        t = np.clip(np.asarray(times, dtype=float), 0.0, self.duration)
        q[:, 2] = self.FROM + (self.TO - self.FROM) * t / self.duration
        qd[:, 2], qdd[:, 2] = (self.TO - self.FROM) / self.duration, 0.0
        return q, qd, qdd

    def instants(self, q):
        """Return when it was at places (N, 3), (N,) [s]."""
        return np.clip((q[:, 2] - self.FROM) / (self.TO - self.FROM), 0.0, 1.0) * self.duration
