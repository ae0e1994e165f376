"""Results by content: a case that has run is never run again, by whatever experiment it is asked for."""

import functools
import hashlib
import json
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, NamedTuple

from catenary import __version__
from catenary.errors import InputError
from catenary.files import json_text, write_atomically
from papers.experiment import Case, Result


class Finished(NamedTuple):
    """What a run leaves: its result, and what it was made with."""

    result: Result
    seconds: float  # by the clock
    processor_seconds: float
    version: str
    source: str  # digest of the package's files
    date: str  # when it ended, UTC
    environment: str = ""  # versions and processor, on which last digits depend


@functools.cache
def source_digest() -> str:
    """Return a digest of the package's source: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    with as_file(files("catenary")) as folder:
        for path in sorted(folder.rglob("*.py")):
            digest.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


class Store:
    """A folder of results, a file each, named by what they were made from."""

    def __init__(self, folder: Path) -> None:
        """Open the folder, which is created if it is missing.

        Raises:
            InputError: It cannot be created.
        """
        self.folder = folder / "cases"
        self.failures = folder / "failures"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"{folder}: cannot hold results: {error.strerror}; name another folder by --out"
            ) from error

    def read(self, case: Case) -> Finished | None:
        """Return what a case left; None where it has not run, or its file is damaged: it runs again then."""
        try:
            content = json.loads((self.folder / f"{case.key}.json").read_text(encoding="utf-8"))
            kept = Finished(**{part: content[part] for part in Finished._fields})
        except (FileNotFoundError, ValueError, KeyError, TypeError):  # not JSON, not UTF-8, not of this form
            return None
        return kept if isinstance(kept.result, dict) else None

    def write(self, case: Case, finished: Finished) -> None:
        """Keep what a case left; a failure of it before is forgotten."""
        content: dict[str, Any] = {
            "function": case.function,
            "revision": case.revision,
            "arguments": case.arguments,
            "robots": case.robots,
            **finished._asdict(),
        }
        write_atomically(self.folder / f"{case.key}.json", json_text(content).encode())
        (self.failures / f"{case.key}.txt").unlink(missing_ok=True)

    def write_failure(self, case: Case, told: str) -> Path:
        """Keep how a case failed, for who looks into it; it runs again the next time."""
        self.failures.mkdir(exist_ok=True)
        path = self.failures / f"{case.key}.txt"
        write_atomically(path, f"{case.label}\ncatenary {__version__}\n\n{told}".encode())
        return path
