"""Results by content: a case that has run is never run again, by whatever experiment it is asked for.

`Store` keeps them while a sweep runs, a file each. `write_raw` puts those of one experiment into one compressed file,
which is committed: tables, pictures and verdicts follow from it without running a robot again.
"""

import functools
import hashlib
import json
import lzma
from collections.abc import Mapping
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
        """Open the folder, which is created if it is missing."""
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
            kept = _finished(json.loads((self.folder / f"{case.key}.json").read_text(encoding="utf-8")))
        except (FileNotFoundError, ValueError, KeyError, TypeError):  # not JSON, not UTF-8, not of this form
            return None
        return kept if isinstance(kept.result, dict) else None

    def write(self, case: Case, finished: Finished) -> None:
        """Keep what a case left; a failure of it before is forgotten."""
        write_atomically(self.folder / f"{case.key}.json", json_text(_content(case, finished)).encode())
        (self.failures / f"{case.key}.txt").unlink(missing_ok=True)

    def write_failure(self, case: Case, text: str) -> Path:
        """Keep how a case failed, for who looks into it; it runs again the next time."""
        self.failures.mkdir(exist_ok=True)
        path = self.failures / f"{case.key}.txt"
        write_atomically(path, f"{case.label}\ncatenary {__version__}\n\n{text}".encode())
        return path


def _content(case: Case, finished: Finished) -> dict[str, Any]:
    of_case = {"function": case.function, "revision": case.revision, "arguments": case.arguments, "robots": case.robots}
    return of_case | finished._asdict()


def _finished(content: Mapping[str, Any]) -> Finished:
    return Finished(**{part: content[part] for part in Finished._fields})


def write_raw(path: Path, kept: Mapping[Case, Finished]) -> None:
    """Write what cases left into one compressed file, the same bytes for the same results."""
    content = json.loads(json_text([_content(case, finished) for case, finished in kept.items()]))
    text = json.dumps(content, separators=(",", ":"))
    write_atomically(path, lzma.compress(text.encode(), preset=9))


def read_raw(path: Path) -> dict[Case, Finished]:
    """Return what cases left, in the order in which they were written."""
    try:
        content = json.loads(lzma.decompress(path.read_bytes()))
        return {
            Case(one["function"], one["revision"], json.dumps(one["arguments"], sort_keys=True)): _finished(one)
            for one in content
        }
    except FileNotFoundError as error:
        raise InputError(f"{path}: no raw results; run {path.name.partition('.')[0]} first") from error
    except (lzma.LZMAError, EOFError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: no file of raw results: {error}") from error
