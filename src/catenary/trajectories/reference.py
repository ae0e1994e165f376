"""The interface of a trajectory: position, velocity and acceleration of every joint at a time."""

from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array


class Reference(NamedTuple):
    """Where the joints should be at one instant."""

    q: Floats  # (n,) [rad|m]
    qd: Floats  # (n,) [rad/s|m/s]
    qdd: Floats  # (n,) [rad/s2|m/s2]


class Trajectory(Protocol):
    """A motion that begins and ends at rest; before it the joints are at its start, after it at its end.

    Position and velocity are continuous, and `qd` is the derivative of `q`, `qdd` that of `qd`.
    """

    @property
    def duration(self) -> float: ...  # noqa: D102  [s]

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s] after the start."""
        ...

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        ...


class SampledTrajectory(ABC):
    """A trajectory that is a function of many times; one time is a sample of one."""

    duration: float  # [s] until all joints are at rest again

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s] after the start."""
        q, qd, qdd = self.sample(as_array("t", t, ()).reshape(1))
        return Reference(q[0], qd[0], qdd[0])

    @abstractmethod
    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n).

        Raises:
            InputError: `times` has another shape or is not finite.
        """
