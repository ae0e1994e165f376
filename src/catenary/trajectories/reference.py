"""What a trajectory gives: position, velocity and acceleration of every joint at a time."""

from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from catenary.arrays import Floats


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
        """Reference at `t` [s] after the start."""
        ...

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """References at many times: q, qd, qdd, each (N, n), at `times` (N,) [s]."""
        ...
