"""Files that commands write: names as typed, and what is refused before any work is done.

A file gets the name that was typed, and nothing is appended. It is refused if it cannot be written, if its name has the
ending of another kind of file, or if another kind of file lies there; an older file of its own kind is replaced.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from typer import BadParameter

from catenary.errors import CatenaryError, InputError
from catenary.file_formats import UNKNOWN, format_named
from catenary.files import card_path

_HEAD = 4096  # [B] of a file in which it says who wrote it


@dataclass(frozen=True)
class FileKind:
    """A kind of file that a command writes."""

    name: str
    endings: tuple[str, ...]  # known endings that its name may have
    is_one: Callable[[Path], bool]  # whether an existing file is one
    has_card: bool = False  # which is written with it


def out_path(typed: str | Path) -> Path:
    """Return the file that --out and its like name; a default, which typer hands over as it is, stays."""
    text = str(typed)
    if not text.strip():
        raise BadParameter("expected the name of a file, got an empty one")
    if text == "-":
        raise BadParameter("- would be standard output; expected the name of a file (/dev/stdout is one)")
    if text.startswith("-"):
        raise BadParameter(f"{text} looks like another option; a file of this name is ./{text}")
    return Path(text)


def refuse_outputs(written: Mapping[str, tuple[Path, FileKind]], read: Sequence[Path] = ()) -> None:
    """Refuse files, by option, that could not or should not be written, before minutes of work that reads others."""
    every: dict[str, tuple[Path, FileKind | None]] = {}
    for option, (path, kind) in written.items():
        every[option] = path, kind
        if kind.has_card:
            every[f"the card of {option}"] = card_path(path), None
    places: list[Path] = []
    for option, (path, _) in every.items():
        if path.exists() and any(os.path.exists(source) and path.samefile(source) for source in read):
            raise InputError(f"{option} {path}: is a file that is read here; expected another")
        if path.absolute() in places:
            raise InputError(f"{option} {path}: something else is written there; expected another file")
        places.append(path.absolute())
    for option, (path, any_kind) in every.items():
        _refuse_unwritable(option, path)
        if any_kind is not None:
            _refuse_other_kind(option, path, any_kind)


def _refuse_unwritable(option: str, path: Path) -> None:
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder, expected a file to write")
    if not path.parent.is_dir():
        what = "is a file, no folder" if path.parent.exists() else "does not exist"
        raise InputError(f"{option} {path}: folder {path.parent} {what}")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{option} {path}: folder {path.parent} cannot be written to")
    if path.exists() and not os.access(path, os.W_OK):
        raise InputError(f"{option} {path}: is write-protected; expected another file")


def _refuse_other_kind(option: str, path: Path, kind: FileKind) -> None:
    ending, expected = path.suffix.lower(), " or ".join(kind.endings)
    if format_named(path) is not UNKNOWN and ending not in kind.endings:
        raise InputError(
            f'{option} {path}: {kind.name} is written: ending "{path.suffix}": expected {expected}, '
            "or a name without an ending"
        )
    if path.is_file() and path.stat().st_size > 0 and not kind.is_one(path):
        raise InputError(
            f"{option} {path}: is there and is something else than {kind.name}, so it is not replaced; "
            "expected another file"
        )


def _holds(*words: bytes) -> Callable[[Path], bool]:
    def is_one(path: Path) -> bool:
        with path.open("rb") as file:
            head = file.read(_HEAD)
        return all(word in head for word in words)

    return is_one


def _has_arrays(*needed: str, without: str = "") -> Callable[[Path], bool]:
    def is_one(path: Path) -> bool:
        from catenary.archives import read_arrays

        try:
            names = set(read_arrays(path))
        except CatenaryError:
            return False
        return names.issuperset(needed) and without not in names

    return is_one


def _is_log(path: Path) -> bool:
    from catenary.recording.parquet_files import open_parquet

    try:
        return b"catenary" in (open_parquet(path).schema_arrow.metadata or {})
    except CatenaryError:
        return False


def _is_picture(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    return head.startswith((b"\x89PNG", b"%PDF")) or b"<svg" in head


_is_designed, _is_designed_text = _has_arrays("t", "q", "dq", "ddq", without="tau"), _holds(b",ddq:")
MODEL = FileKind("a calibration model", (".npz",), _has_arrays("structure", "card", without="combination"), True)
PARAMETERS = FileKind("an arm's parameters", (".npz",), _has_arrays("structure", "combination"), True)
LOG = FileKind("a motion log", (".parquet",), _is_log)
EXCITATION = FileKind("a motion or poses", (".npz", ".csv"), lambda path: _is_designed(path) or _is_designed_text(path))
EXTERNAL = FileKind("external torques", (".csv",), _holds(b"external:"))
TRAJECTORY = FileKind("a trajectory", (".json", ".yaml"), _holds(b'"joint_names"', b'"points"'))
TOOL = FileKind("a tool file", (".toml",), _holds(b"force_bias", b"center"))
MOUNTING = FileKind("a mounting file", (".toml",), _holds(b"[accelerometer]", b"[mounting]"))
HEADER = FileKind("a C header", (".h",), _holds(b"written by catenary"))
URDF = FileKind("a URDF", (".urdf", ".xml"), _holds(b"<robot"))
PICTURE = FileKind("a picture", (".png", ".svg", ".pdf"), _is_picture)
PAGE = FileKind("a page", (".html", ".htm"), _holds(b"<!doctype html>"))

NAMED_AS_TYPED = "The name is taken as typed; an older file is replaced, another kind of file never."
