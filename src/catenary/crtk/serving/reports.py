"""What a server has to say about commands that it did not obey: counted always, said now and then."""

import logging
from collections import deque
from dataclasses import dataclass

from catenary.topics import SECOND

_logger = logging.getLogger(__name__)
_TEXT_CHARACTERS = 500  # characters of a text: a message may have quoted much of what was sent
_QUIET_NS = 5 * SECOND  # [ns] between two sayings of the same kind


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
        self._told: deque[tuple[str, str]] = deque(maxlen=20)

    def say(
        self, kind: str, text: str, now: int, *, to: tuple[str, ...] = (), each: bool = False, times: int = 1
    ) -> None:
        """Count a trouble of a kind, such as "/arm1/servo_jr: refused"; log it unless one was logged within 5 s.

        Clients of the arms in `to` are notified when it is logged, with `each` each time; `now` in ns.
        """
        text = text[:_TEXT_CHARACTERS]
        report = self.kinds.setdefault(kind, Report(text))
        report.count += times
        report.text = text
        is_fresh = report.said is None or not 0 <= now - report.said < _QUIET_NS
        if is_fresh or each:
            self._told.extend((arm, f"{kind}: {text}") for arm in to)
        if is_fresh:
            report.said = now
            often = f" ({report.count} times so far)" if report.count > 1 else ""
            line = f"{kind}: {text}{often}"
            self._fresh.append(line)
            del self._fresh[:-20]  # nobody may be asking for them
            _logger.warning("%s", line)

    def take_told(self) -> list[tuple[str, str]]:
        """Return the new reports for clients of arms, the latest 20."""
        reports = list(self._told)
        self._told.clear()
        return reports

    def take(self) -> list[str]:
        """Return the new log lines, the latest 20."""
        fresh, self._fresh = self._fresh, []
        return fresh
