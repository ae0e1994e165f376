"""What a server has to say about commands that it did not obey: counted always, said now and then."""

import logging
from dataclasses import dataclass

from catenary.crtk.clock import SECOND

_logger = logging.getLogger(__name__)
QUIET = 5 * SECOND  # [ns] between two sayings of the same kind


@dataclass
class Report:
    """One kind of trouble."""

    text: str  # of its latest occurrence
    count: int = 0
    said: int | None = None  # [ns] when it was last logged


class Reports:
    """Troubles by kind. A client that sends nonsense at 1 kHz fills no log and costs no tick."""

    def __init__(self) -> None:
        self.kinds: dict[str, Report] = {}
        self._fresh: list[str] = []

    def say(self, kind: str, text: str, now: int) -> None:
        """Count a trouble, and log it unless one of its kind was logged within 5 s.

        Args:
            kind: What it is, such as "/arm1/servo_jr: refused".
            text: What happened this time.
            now: [ns].
        """
        report = self.kinds.setdefault(kind, Report(text))
        report.count += 1
        report.text = text
        if report.said is None or not 0 <= now - report.said < QUIET:
            report.said = now
            times = f" ({report.count} times so far)" if report.count > 1 else ""
            line = f"{kind}: {text}{times}"
            self._fresh.append(line)
            del self._fresh[:-20]  # nobody may be asking for them
            _logger.warning("%s", line)

    def count(self, kind: str) -> int:
        """How often a kind of trouble occurred."""
        return self.kinds[kind].count if kind in self.kinds else 0

    def take(self) -> list[str]:
        """Return what was logged since the last time, the latest 20."""
        fresh, self._fresh = self._fresh, []
        return fresh
