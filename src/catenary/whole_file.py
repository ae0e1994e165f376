"""Files that appear whole or not at all."""

import contextlib
import os
from pathlib import Path

from catenary.errors import FileFormatError


def write_whole(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there when it is complete.

    Raises:
        FileFormatError: The file cannot be written.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise FileFormatError(f"{path}: cannot be written: {error.strerror or error}") from error
