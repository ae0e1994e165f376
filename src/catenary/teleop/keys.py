"""Bytes of a terminal as keys: characters, and the escape sequences of arrows and pages, whole or in pieces."""

import codecs
import re

ESCAPE = "\x1b"
# [s] that the rest of an escape sequence may be under way; over SSH it may come in two packets
PATIENCE = 0.05
_SEQUENCES = {
    "A": "up",
    "B": "down",
    "C": "right",
    "D": "left",
    "5~": "page up",
    "6~": "page down",
}
_LONGEST = 16  # characters; what is longer is no key
# a sequence, which ends with its first character from @ to ~ [ECMA-48, section 5.4]; Alt and a key; escape; a character
_TOKEN = re.compile(r"\x1b[\[O](?P<sequence>[^@-~]*[@-~])|\x1b[^\x1b\[O]|(?P<key>\x1b(?=\x1b)|[^\x1b])")


class KeyReader:
    """Puts keys together whose bytes come in pieces; waits for the rest of one for PATIENCE.

    Printable characters are themselves, also those beyond ASCII; `up`, `down`, `left`, `right`, `page up`,
    `page down`, `escape`. Sequences of other keys are passed over whole, so that none of their letters moves a robot.
    """

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("ignore")
        self._rest = ""  # the beginning of a sequence
        self._since = 0.0

    def feed(self, data: bytes, now: float) -> list[str]:
        """Take what came at a time [s], which may be nothing, and return the keys that are whole."""
        if data and not self._rest:
            self._since = now
        text, self._rest = self._rest + self._decoder.decode(data), ""
        keys, end = [], 0
        while found := _TOKEN.match(text, end):
            end = found.end()
            key = found["key"] or _SEQUENCES.get(found["sequence"] or "", "")
            if key == ESCAPE:
                key = "escape"
            if key and key.isprintable():
                keys.append(key)
        rest = text[end:]
        if not data and now - self._since > PATIENCE:  # nothing more is under way
            return [*keys, "escape"] if rest == ESCAPE else keys
        self._rest = rest if len(rest) <= _LONGEST else ""
        return keys
