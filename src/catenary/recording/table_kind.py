"""How a file of columns is read: by its name's ending, or by its first bytes where the name says nothing."""

from pathlib import Path

_ENDINGS = (".npz", ".parquet", ".csv", ".npy", ".mat", ".txt")
_FIRST_BYTES = {b"PAR1": ".parquet", b"PK\x03\x04": ".npz"}  # Parquet's and zip's own marks


def table_ending(path: Path) -> str:
    """Return the ending that says how a table is read, in small letters.

    A model or log may be written under any name (`--out arm`); such a file is known by its first bytes. A file that
    cannot be opened has the ending of its name, and so has one of no known kind.
    """
    ending = path.suffix.lower()
    if ending in _ENDINGS:
        return ending
    try:
        with path.open("rb") as file:
            return _FIRST_BYTES.get(file.read(4), ending)
    except OSError:
        return ending
