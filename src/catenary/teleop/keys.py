"""Bytes of a terminal as keys: characters, and the escape sequences of arrows and pages, whole or in pieces."""

ESCAPE = b"\x1b"
# [s] that the rest of an escape sequence may be under way; over SSH it may come in two packets
PATIENCE = 0.05
_SEQUENCES = {
    b"A": "up",
    b"B": "down",
    b"C": "right",
    b"D": "left",
    b"5~": "page up",
    b"6~": "page down",
}
_LONGEST = 16  # bytes; what is longer is no key


def decode_keys(data: bytes, *, final: bool = False) -> tuple[list[str], bytes]:
    """Return the keys in what a terminal sent, and the bytes of one that is not yet there as a whole.

    Printable characters are themselves, also those beyond ASCII; `up`, `down`, `left`, `right`, `page up`,
    `page down`, `escape`. Sequences of other keys are passed over whole, so that none of their letters moves a robot.

    Args:
        data: Bytes, in order.
        final: Nothing more is under way: a lone escape is the key.
    """
    keys: list[str] = []
    while data:
        if data[:1] != ESCAPE:
            text, data, waiting = _character(data, final)
            if waiting:
                return keys, data
            keys += [text] if text else []
            continue
        if len(data) == 1:
            return ([*keys, "escape"], b"") if final else (keys, data)
        if data[1:2] == ESCAPE:
            keys.append("escape")
            data = data[1:]
            continue
        if data[1:2] not in (b"[", b"O"):
            data = data[2:]  # Alt and a key: nothing of ours
            continue
        end = _end_of_sequence(data)
        if end is None:
            if final or len(data) > _LONGEST:
                return keys, b""
            return keys, data
        key = _SEQUENCES.get(data[2:end])
        keys += [key] if key else []
        data = data[end:]
    return keys, b""


def _end_of_sequence(data: bytes) -> int | None:
    """Return where a sequence ends: after its first byte from @ to ~, ECMA-48 section 5.4."""
    return next((k + 1 for k in range(2, len(data)) if 0x40 <= data[k] <= 0x7E), None)


def _character(data: bytes, final: bool) -> tuple[str, bytes, bool]:
    """Return the first character, what follows it, and whether more of its bytes are under way."""
    # the first byte of UTF-8 tells how many there are
    size = next((size for size, least in ((4, 0xF0), (3, 0xE0), (2, 0xC0)) if data[0] >= least), 1)
    if len(data) < size and not final:
        return "", data, True
    text = data[:size].decode("utf-8", errors="ignore")
    return text if text.isprintable() else "", data[size:], False


class KeyReader:
    """Puts keys together whose bytes come in pieces; waits for the rest of one for PATIENCE."""

    def __init__(self) -> None:
        self._rest = b""
        self._since = 0.0

    def feed(self, data: bytes, now: float) -> list[str]:
        """Take what came at a time [s], which may be nothing, and return the keys that are whole."""
        if data and not self._rest:
            self._since = now
        final = not data and bool(self._rest) and now - self._since > PATIENCE
        if not data and not final:
            return []
        keys, self._rest = decode_keys(self._rest + data, final=final)
        return keys
