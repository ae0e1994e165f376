"""Registry of gravity fallbacks (hold, fade, static, stop): gravity used when samples stop, and its help text."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:  # help reads these records, and starts without NumPy
    from catenary.arrays import Floats


class Believed(Protocol):
    """Past gravity that a fallback can use, each (3,) in base axes [m/s2]."""

    def newest_gravity(self) -> "Floats":
        """Return gravity at the newest accepted sample."""

    def mean_gravity(self) -> "Floats":
        """Return gravity of standard length along the mean direction of the last seconds."""


@dataclass(frozen=True)
class Fallback:
    """Substitute for gravity that is no longer measured.

    Args:
        name: Name in options and configuration.
        gravity: Substitute (3,) [m/s2] in base axes; None for that of a level base, which has no age.
        stops: Stop the robot, also if no sample is accepted within the start limit.
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
