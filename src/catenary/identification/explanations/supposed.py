"""What one hypothesis supposes was done to a recording, or is true of its arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Supposed:
    """Changes that lie between the arm's motion and the recording of it, and what the arm has beside its file."""

    signs: tuple[float, ...]  # (n,) of recorded positions: -1 where they count the other way
    zeros: tuple[float, ...]  # (n,) [rad or m] that recorded positions are too large by
    position_order: tuple[int, ...]  # column of the recording that holds each joint's position
    torque_order: tuple[int, ...]  # the same of its torque
    gains: tuple[float, ...]  # (n,) of recorded torques to true ones
    gravity: tuple[float, ...] | None = None  # (3,) [m/s2] in base axes; None: as stated or recorded
    late_s: float = 0.0  # [s] that torques lie behind positions
    loads: tuple[int, ...] = ()  # links that carry a body which the prior of masses lacks
    shared: tuple[tuple[int, int, float], ...] = ()  # joints on one drive, and the sign of the second
    shifted: tuple[int, ...] = ()  # joints whose torque has another zero than was identified

    @property
    def motion(self) -> tuple[Any, ...]:
        """What decides on the columns of the regressor."""
        return self.signs, self.zeros, self.position_order, self.gravity, self.shared

    def with_one(self, field: str, joint: int, value: float) -> "Supposed":
        """Return it with another number of one joint."""
        values: list[float] = list(getattr(self, field))
        values[joint] = value
        return replace(self, **{field: tuple(values)})  # type: ignore[arg-type]  # a field by its name

    def with_swapped(self, fields: Sequence[str], i: int, j: int) -> "Supposed":
        """Return it with two joints exchanged in some orders."""
        changed: dict[str, Any] = {}
        for field in fields:
            order = list(getattr(self, field))
            order[i], order[j] = order[j], order[i]
            changed[field] = tuple(order)
        return replace(self, **changed)


def nothing_supposed(n: int) -> Supposed:
    """Return that a recording of n joints is as it says."""
    order = tuple(range(n))
    return Supposed((1.0,) * n, (0.0,) * n, order, order, (1.0,) * n)
