"""What URDF and MJCF files have in common: hash, names, errors, joints that follow other joints."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from catenary.documents import MOST_XML, read_bounded
from catenary.errors import FileFormatError, InputError, UnsupportedModelError


def read_description(path: Path) -> bytes:
    """Return a file's content.

    Raises:
        FileFormatError: The file is missing, cannot be read, or is too long.
    """
    return read_bounded(path, MOST_XML)


def file_source(path: Path, content: bytes) -> str:
    """Return a line on which file a model comes from, so that a copy can be told from another version."""
    return f"{path.name}, sha256 {sha256(content).hexdigest()}"


@contextmanager
def naming_the_file(where: str) -> Iterator[None]:
    """Prefix errors about a model's numbers with the file that holds them."""
    try:
        yield
    except InputError as error:
        raise FileFormatError(f"{where}: {error}") from error
    except UnsupportedModelError as error:
        raise UnsupportedModelError(f"{where}: {error}") from error


def left_out(what: str, where: Iterable[str]) -> list[str]:
    """Return one line on something that the model leaves out, or none when there is nothing."""
    names = list(where)
    return [f"left out: {what} ({', '.join(names)})"] if names else []


class Mimic(NamedTuple):
    """A joint's position is multiplier * (the leader's position) + offset; a constant without a leader."""

    leader: str | None
    multiplier: float
    offset: float  # [rad or m]


def resolve_mimics(mimics: Mapping[str, Mimic]) -> dict[str, Mimic]:
    """Express each following joint, q = multiplier * q_leader + offset, by a joint that is free.

    Args:
        mimics: The following joints, by name; a leader that is not among them is free.

    Raises:
        UnsupportedModelError: Joints follow each other in a loop.
    """
    resolved: dict[str, Mimic] = {}
    for joint, first in mimics.items():
        chain = [joint]
        here = first
        while here.leader is not None and here.leader in mimics:
            if here.leader in chain:
                raise UnsupportedModelError(
                    f'joint "{joint}" follows itself: {" -> ".join([*chain, here.leader])}; '
                    "expected a chain of mimic joints that ends at one that is free"
                )
            chain.append(here.leader)
            then = mimics[here.leader]
            here = Mimic(
                then.leader, here.multiplier * then.multiplier, here.multiplier * then.offset + here.offset
            )
        resolved[joint] = here
    return resolved
