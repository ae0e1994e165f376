"""Fallbacks by name, one record each: what gravity becomes when samples stop, and what the help says of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.arrays import Floats


class Believed(Protocol):
    """What a fallback may know, each (3,) in base axes [m/s2]."""

    def newest_gravity(self) -> "Floats":
        """Return gravity as of the newest believed sample."""

    def mean_gravity(self) -> "Floats":
        """Return gravity of standard length along its mean direction of the last seconds."""


@dataclass(frozen=True)
class Fallback:
    """What takes the place of gravity that is not measured any more.

    Args:
        name: As it is typed.
        words: What it is, in the words of the help.
        gravity: What gravity becomes; that of a level base when None, which has no age.
        stops: The robot is stopped, also when no sample was believed for a second.
    """

    name: str
    words: str
    gravity: Callable[[Believed], "Floats"] | None
    stops: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"


_RECORDS = (
    Fallback("hold", "as of the newest sample", lambda believed: believed.newest_gravity()),
    Fallback("fade", "along the mean direction of the last seconds", lambda believed: believed.mean_gravity()),
    Fallback("static", "of a level base", None),
    Fallback("stop", "the robot stops", lambda believed: believed.newest_gravity(), stops=True),
)
FALLBACKS = {fallback.name: fallback for fallback in _RECORDS}
