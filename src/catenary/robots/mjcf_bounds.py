"""What an MJCF file asks for, counted before MuJoCo is given it: a line of it can ask for gigabytes."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from catenary.documents import MOST_XML, cut, read_bounded, shortened, xml_tree
from catenary.errors import FileFormatError, UnsupportedModelError
from catenary.robots.plausible import MOST_LINKS

MOST_ELEMENTS = 10_000  # MuJoCo's time grows with the square of their number
MOST_FILES = 100  # that a file includes
MOST_ITEMS = 2**24  # pixels and heights of all images together
MOST_RESERVED = 10_000  # of one thing that <size> reserves
IMAGES = {"texture": ("width", "height"), "hfield": ("nrow", "ncol")}
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)


def mjcf_tree(content: bytes, where: str) -> Element:
    """Return the root element; comments are left out first, as MuJoCo allows "--" in them and XML does not.

    Raises:
        FileFormatError: As `xml_tree`.
    """
    return xml_tree(_COMMENT.sub(lambda found: b"\n" * found[0].count(b"\n"), content), where)


def included_files(path: Path, content: bytes) -> dict[str, bytes]:
    """Return the files that <include> brings in, by the name it gives them, relative to the main file.

    Raises:
        FileFormatError: One is outside the main file's folder, they are too many or too long, or one is no XML.
    """
    found: dict[str, bytes] = {}
    waiting = [(str(path), content)]
    folder = path.parent.resolve()
    while waiting:
        where, text = waiting.pop()
        for name in (element.get("file", "") for element in mjcf_tree(text, where).iter("include")):
            place = path.parent / name.replace("\0", "")
            if name in found or not place.is_file():
                continue  # MuJoCo says what it misses
            if not place.resolve().is_relative_to(folder):
                raise FileFormatError(f"{where}: <include file={shortened(name)}>: is outside {path.parent}")
            found[name] = read_bounded(place, MOST_XML)
            if len(found) > MOST_FILES or sum(map(len, found.values())) > MOST_XML:
                raise FileFormatError(
                    f"{path}: includes more than {MOST_FILES} files, or more than {MOST_XML} bytes"
                )
            waiting.append((str(place), found[name]))
    return found


def refuse_too_much(path: Path, content: bytes, included: Mapping[str, bytes]) -> None:
    """Refuse a file that asks for more than a robot has: bodies, pixels, reserved numbers.

    Raises:
        FileFormatError: It asks for too much; the message says of what.
        UnsupportedModelError: It has a flexible body.
    """
    trees = {name: mjcf_tree(text, str(path.parent / name)) for name, text in included.items()}
    elements = bodies = items = 0
    for element, times in _elements(mjcf_tree(content, str(path)), trees):
        elements += times
        if element.tag in ("flex", "flexcomp"):
            name = cut(element.get("name", ""))
            raise UnsupportedModelError(f'{path}: flexible body "{name}": expected rigid bodies only')
        if element.tag == "body":
            bodies += times
        elif element.tag == "composite":
            bodies += times * _product(element.get("count", "").split())
        elif element.tag in IMAGES:
            items += _product([element.get(key, "1") for key in IMAGES[element.tag]])
        elif element.tag == "size":
            for key, text in element.attrib.items():
                if key.startswith(("nuser_", "nkey")) and _product([text]) > MOST_RESERVED:
                    raise FileFormatError(
                        f"{path}: <size {key}={shortened(text)}>: expected at most {MOST_RESERVED}"
                    )
        if bodies > MOST_LINKS or elements > MOST_ELEMENTS:
            raise FileFormatError(
                f"{path}: more than {MOST_LINKS} bodies or {MOST_ELEMENTS} elements, copies by <replicate> included"
            )
    if items > MOST_ITEMS:
        raise FileFormatError(
            f"{path}: textures and height fields of {items} points, expected at most {MOST_ITEMS}"
        )


def _elements(root: Element, included: Mapping[str, Element]) -> Iterator[tuple[Element, int]]:
    """Yield every element and how often <replicate> makes it; a file that includes itself is gone through once."""
    waiting, seen = [(root, 1)], set[str]()
    while waiting:
        element, times = waiting.pop()
        yield element, times
        name = element.get("file", "") if element.tag == "include" else ""
        if name in included and name not in seen:
            seen.add(name)
            waiting.append((included[name], times))
        within = times * (_product([element.get("count", "1")]) if element.tag == "replicate" else 1)
        waiting += [(child, within) for child in element]


def _product(words: list[str]) -> int:
    """Return the product of whole numbers; those that are none are MuJoCo's to refuse."""
    product = 1
    for word in words:
        found = re.fullmatch(r"\s*\+?(\d{1,18})(\.\d*)?\s*", word)
        if found:
            product *= int(found[1])
        elif re.fullmatch(r"\s*[-+\w.]{18,}\s*|.*[eE].*", word):
            product *= 10**18  # not written as a number of this size is
    return product
