"""Files that appear whole or not at all, their fingerprints, and JSON that every reader takes."""

import contextlib
import hashlib
import json
import math
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from catenary.errors import FileFormatError
from catenary.operating_system import OPEN_FILES_CAN_MOVE, OWN_FILE, WITHOUT_WAITING, lock, move_open, sync_folder

PARTIAL = ".partial"  # how the names of files end that are being written
_OURS = re.compile(rf"\.[0-9a-f]{{16}}\{PARTIAL}")
_NEWBORN_S = 60.0  # [s] for which what is empty may be locked yet


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """Write a file that appears whole or not at all, and is on the disk when it appears.

    Written under another name in the same folder, one that nobody can guess and nothing had (O_EXCL, O_NOFOLLOW);
    then fsync, rename, fsync of the folder. A symbolic link at `path` is replaced by the file, and what it points to
    stays as it was; links in the folder's own name are followed. A device, a pipe and the links to them in /dev and
    /proc, such as /dev/stdout, are written to directly. What processes that were killed left in the folder is deleted.
    """
    if "\0" in str(path):
        raise FileFormatError(f"{path}: cannot be written: no file's name holds a zero byte")
    partial = path.parent / _partial_name()
    try:
        if _is_stream(path):
            with path.open("wb") as file:
                yield file
            return
        sweep_partial(path.parent)
        with open(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OWN_FILE, 0o666), "wb") as file:
            with contextlib.suppress(OSError):  # on a file system without locks nothing is swept either
                lock(file.fileno())
            yield file
            file.flush()
            os.fsync(file.fileno())
            move_open(file, partial, path)
        sync_folder(path.parent)
    except BaseException as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            raise FileFormatError(f"{path}: cannot be written: {error.strerror or error}") from error
        raise


@contextlib.contextmanager
def partial_folder(parent: Path) -> Iterator[Path]:
    """Make a folder to write in, under a name of its own, deleted at the end; see `written_whole`."""
    sweep_partial(parent)
    folder = parent / _partial_name()
    folder.mkdir(mode=0o700)
    with contextlib.ExitStack() as at_end:
        with contextlib.suppress(OSError):  # where folders cannot be opened or locked, none is swept either
            descriptor = os.open(folder, os.O_RDONLY | OWN_FILE)
            at_end.callback(os.close, descriptor)
            lock(descriptor)
        at_end.callback(shutil.rmtree, folder, ignore_errors=True)
        yield folder


def sweep_partial(folder: Path) -> None:
    """Delete what processes that are gone were writing in a folder; what one that lives writes is locked by it."""
    with contextlib.suppress(OSError):
        for name in filter(_OURS.fullmatch, os.listdir(folder)):
            with contextlib.suppress(OSError):  # locked, another user's, or gone meanwhile
                descriptor = os.open(folder / name, os.O_RDONLY | OWN_FILE | WITHOUT_WAITING)
                try:
                    lock(descriptor)
                    state, is_folder = os.fstat(descriptor), (folder / name).is_dir()
                finally:
                    os.close(descriptor)  # what is open cannot be deleted everywhere
                is_written = state.st_size > 0 and not is_folder and OPEN_FILES_CAN_MOVE
                if is_written or time.time() - state.st_mtime > _NEWBORN_S:
                    (shutil.rmtree if is_folder else os.unlink)(folder / name)


def _partial_name() -> str:
    return f".{secrets.token_hex(8)}{PARTIAL}"


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file that appears whole or not at all.

    Args:
        path, content: The file, which is replaced if it exists, and its bytes.
    """
    with written_whole(path) as file:
        file.write(content)


def _is_stream(path: Path) -> bool:
    if not path.is_symlink():
        return path.exists() and not path.is_file()
    return path.absolute().parts[1] == "proc" or path.absolute().parent in (Path("/dev"), Path("/dev/fd"))


def card_path(path: Path) -> Path:
    """Return the path of the readable copy of a model's or parameters' card, beside the file."""
    return path.parent / f"{path.name.removesuffix('.npz')}.card.json"


def card_text(card: Mapping[str, Any]) -> str:
    """Return a card as it stands inside a file and beside it."""
    return json.dumps(card, indent=2, ensure_ascii=False) + "\n"


def damage(path: Path, why: object, remedy: str) -> str:
    """Return the message about a damaged file: which, what is wrong, how to make it again.

    Args:
        why: What is wrong with it; an empty file is reported as such.
        remedy: How such a file is made again.
    """
    is_empty = path.is_file() and path.stat().st_size == 0
    return f"{path}: damaged: {'it is empty' if is_empty else why}; {remedy}"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, in hexadecimal; results name their inputs by it."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def fingerprint(content: Any) -> str:
    """Return the SHA-256 of plain data."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


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
