"""Files that appear whole or not at all, their fingerprints, and JSON that every reader takes."""

import contextlib
import hashlib
import json
import math
import os
from pathlib import Path
from typing import Any

from catenary.errors import FileFormatError


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there when it is complete; a device or pipe is written to directly.

    Raises:
        FileFormatError: The file cannot be written.
    """
    partial = path.parent / f".{path.name}.partial"
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(content)
        else:
            partial.write_bytes(content)
            os.replace(partial, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise FileFormatError(f"{path}: cannot be written: {error.strerror or error}") from error


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal; results name their inputs by it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def json_text(content: Any) -> str:
    """Return plain data as indented ASCII JSON; NaN and infinity, which JSON does not know, become null."""
    return json.dumps(_finite(content), indent=2, allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {str(key): _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    if hasattr(content, "tolist"):  # a NumPy array or number; NumPy itself need not be loaded here
        return _finite(content.tolist())
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content
