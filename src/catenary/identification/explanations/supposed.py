"""A hypothesis' suppositions about changes to a recording, or about its arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple


class Added(NamedTuple):
    """What torques have beside what the arm asks, linear in one number or several."""

    shape: str  # zero, drift, friction or load
    joint: int  # whose torque has it; of a load -1, as it is on the tip
    sizes: tuple[float, ...]  # standard deviations of its numbers beforehand
    after: float | None = None  # [s] from when on; all along when None


@dataclass(frozen=True)
class Supposed:
    """Changes that lie between the arm's motion and the recording of it, and what the arm has beside its file."""

    signs: tuple[float, ...]  # (n,) of recorded positions: -1 where they count the other way
    zeros: tuple[float, ...]  # (n,) [rad or m] that recorded positions are too large by
    position_order: tuple[int, ...]  # column of the recording that holds each joint's position
    torque_order: tuple[int, ...]  # the same of its torque
    gains: tuple[float, ...]  # (n,) of recorded torques to true ones
    late_s: tuple[float, ...]  # (n,) [s], delay of torques behind positions
    gravity: tuple[float, ...] | None = None  # (3,) [m/s2] in base axes; None: as stated or recorded
    loads: tuple[int, ...] = ()  # links that carry a body which the prior of masses lacks
    shared: tuple[tuple[int, int, float], ...] = ()  # joints on one drive, and the sign of the second
    added: tuple[Added, ...] = ()
    turned: tuple[tuple[int, float], ...] = ()  # joints whose torque has the other sign, and from when on [s]

    @property
    def motion(self) -> tuple[Any, ...]:
        """What decides on the columns of the regressor."""
        return self.signs, self.zeros, self.position_order, self.gravity, self.shared

    def with_one(self, field: str, joint: int, value: float) -> "Supposed":
        """Return the supposition with another number for one joint."""
        values: list[float] = list(getattr(self, field))
        values[joint] = value
        return replace(self, **{field: tuple(values)})  # type: ignore[arg-type]  # a field by its name

    def with_swapped(self, fields: Sequence[str], i: int, j: int) -> "Supposed":
        """Return the supposition with two joints exchanged in some orders."""
        changed: dict[str, Any] = {}
        for field in fields:
            order = list(getattr(self, field))
            order[i], order[j] = order[j], order[i]
            changed[field] = tuple(order)
        return replace(self, **changed)


def nothing_supposed(n: int) -> Supposed:
    """Return that a recording of n joints is as it says."""
    order = tuple(range(n))
    return Supposed((1.0,) * n, (0.0,) * n, order, order, (1.0,) * n, (0.0,) * n)
