"""Text from files and messages as a terminal may be given it: nothing in it moves the cursor or turns writing round."""

import re
from math import isfinite
from typing import Any

# C0 but for tab and line feed, DEL, C1, marks and overrides of direction, line and paragraph separators; what stands
# for bytes of a path that are no UTF-8
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def visible(text: str) -> str:
    """Return text with control characters written out, as JSON does it."""
    return _CONTROL.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def range_bar(value: float, low: float, high: float, characters: int) -> str:
    """Return the position of a value between its limits as text, [...#........]; "no limits" where one is not finite.

    Args:
        characters: Width without brackets.
    """
    if not all(map(isfinite, (value, low, high))):
        return "no limits"
    place = int(min(max((value - low) / (high - low), 0.0), 1.0) * (characters - 1) + 0.5)
    return "[" + "." * place + "#" + "." * (characters - 1 - place) + "]"


class ClosedOutput(BrokenPipeError):
    """The reader of the output has closed it, as `head` does."""


class VisibleStream:
    """A text stream through which no control character passes; all else is the stream's own.

    Programs that draw on a terminal, such as progress bars, write to `stream`.
    """

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        """Write text; return its length."""
        try:
            self.stream.write(visible(text))
        except BrokenPipeError as error:
            raise ClosedOutput from error
        return len(text)

    def flush(self) -> None:
        """Write what is held back."""
        try:
            self.stream.flush()
        except BrokenPipeError as error:
            raise ClosedOutput from error

    def writelines(self, lines: Any) -> None:
        """Write texts."""
        for line in lines:
            self.write(line)
