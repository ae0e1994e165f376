"""Raw terminal with single-key input, restored on every exit, and a decoder of key sequences."""

import codecs
import os
import re
import signal
import sys
from collections.abc import Callable
from select import select
from shutil import get_terminal_size
from types import FrameType
from typing import Any, Self

from catenary.errors import InputError
from catenary.operating_system import ENDING_SIGNALS, HAS_SINGLE_KEYS, single_keys

_ESCAPE = "\x1b"
# [s] timeout of the rest of an escape sequence, which may arrive in two packets over SSH
_SEQUENCE_WITHIN_S = 0.05
_SEQUENCES = {"A": "up", "B": "down", "C": "right", "D": "left", "5~": "page up", "6~": "page down"}
_SEQUENCE_CHARACTERS = 16  # longest sequence of a key
# a sequence, which ends with its first character from @ to ~ [ECMA-48, section 5.4]; Alt and a key; escape; a character
_TOKEN = re.compile(r"\x1b[\[O](?P<sequence>[^@-~]*[@-~])|\x1b[^\x1b\[O]|(?P<key>\x1b(?=\x1b)|[^\x1b])")


class KeyReader:
    """Decode keys from a stream of bytes, waiting 50 ms for the rest of a sequence; unknown ones are ignored."""

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        self._rest = ""  # the beginning of a sequence
        self._since = 0.0

    def feed(self, data: bytes, now: float) -> list[str]:
        """Add bytes received at a time [s], possibly none, and return the complete keys."""
        if data and not self._rest:
            self._since = now
        text, self._rest = self._rest + self._decoder.decode(data), ""
        keys, end = [], 0
        while token := _TOKEN.match(text, end):
            end = token.end()
            key = token["key"] or _SEQUENCES.get(token["sequence"] or "", "")
            if key == _ESCAPE:
                key = "escape"
            if key and key.isprintable():
                keys.append(key)
        remaining = text[end:]
        if not data and now - self._since > _SEQUENCE_WITHIN_S:  # timeout
            return [*keys, "escape"] if remaining == _ESCAPE else keys
        self._rest = remaining if len(remaining) <= _SEQUENCE_CHARACTERS else ""
        return keys


_OPEN = "\x1b[?1049h\x1b[?25l\x1b[2J"  # alternate screen, no cursor
_CLOSE = "\x1b[?25h\x1b[?1049l"


class RawTerminal:
    """Standard input and output in raw mode, as a context manager. Ctrl-C interrupts, Ctrl-Z suspends."""

    def __init__(self) -> None:
        if not (HAS_SINGLE_KEYS and sys.stdin.isatty() and sys.stdout.isatty()):
            raise InputError("teleop: needs a terminal of Linux or macOS for keys; over SSH give it one with ssh -t")
        self._in, self._out = sys.stdin.fileno(), sys.stdout.fileno()
        self._put_back: Callable[[], None] = lambda: None
        self._handlers: dict[int, Any] = {}
        self.ended: str | None = None  # name of the ending signal, or a lost terminal
        self.wants_suspension = False  # after Ctrl-Z: call `suspend` when the robot is safe
        self._last: list[str] = []

    def __enter__(self) -> Self:
        for number in ENDING_SIGNALS:
            self._handlers[number] = signal.signal(number, self._end)
        self._handlers[signal.SIGTSTP] = signal.signal(signal.SIGTSTP, self._ask)
        self._open()
        return self

    def __exit__(self, *exception: object) -> None:
        self._close()
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()

    @property
    def size(self) -> tuple[int, int]:
        """Present number of columns and lines."""
        return get_terminal_size()

    def read(self) -> bytes:
        """Return the bytes typed so far, without waiting."""
        if not select([self._in], [], [], 0.0)[0]:
            return b""
        try:
            data = os.read(self._in, 4096)
        except OSError:
            data = b""
        if not data:
            self.ended = "the terminal is gone"
        return data

    def draw(self, lines: list[str]) -> None:
        """Show lines; only changed ones are sent, in one write, to avoid flicker."""
        is_new = len(lines) != len(self._last)
        text = "\x1b[2J" if is_new else ""
        for k, line in enumerate(lines):
            if is_new or self._last[k] != line:
                text += f"\x1b[{k + 1};1H{line}\x1b[K"
        self._last = list(lines)
        self._write(text)

    def _open(self) -> None:
        self._put_back = single_keys(self._in)
        self._last = []
        self._write(_OPEN)

    def _close(self) -> None:
        self._write(_CLOSE)
        self._put_back()

    def _write(self, text: str) -> None:
        data = text.encode("utf-8")
        try:
            while data:
                data = data[os.write(self._out, data) :]
        except OSError:
            self.ended = "the terminal is gone"

    def _end(self, number: int, _: FrameType | None) -> None:
        self.ended = signal.Signals(number).name

    def _ask(self, number: int, _: FrameType | None) -> None:
        self.wants_suspension = True

    def suspend(self) -> None:
        """Stop this process until it is continued, with the terminal restored."""
        self.wants_suspension = False
        self._close()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)  # stops here, until SIGCONT
        signal.signal(signal.SIGTSTP, self._ask)
        self._open()
