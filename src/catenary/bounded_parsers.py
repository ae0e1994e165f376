"""Size-limited parsers of JSON, TOML and XML for untrusted files.

Every complaint is a FileFormatError that names the file, the place in it and the reason. What a document has to hold
is its schema's business (`config`).
"""

import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from catenary.errors import FileFormatError
from catenary.file_formats import copied_as_text

MAX_JSON_BYTES = 8 * 2**20  # [B]; the longest that is written, the steps of a large project, has some 100 kB
MAX_TOML_BYTES = 2**19  # [B]; the longest robot of the catalogue has 12 kB, and tomllib is slow
MAX_XML_BYTES = 16 * 2**20  # [B]; published humanoids have less than 1 MB
MAX_LEVELS = 64  # tables within lists within tables; what is written here goes 8 deep
_MAX_ELEMENTS = 100_000  # of an XML file
_MAX_INTEGER = 2**128  # of integers: seeds of NumPy have up to 128 bits
_MAX_CHARACTERS = 200  # characters of a value or a message that an error repeats

# a text of JSON, which may hold // and /*, or a comment; one that does not end goes to the end of the file
_TEXT_OR_COMMENT = re.compile(rb'"(?:\\.|[^"\\])*+(?:"|\\?\Z)|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
XML_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)  # MuJoCo allows "--" within, XML does not
_ROOT_TAG = re.compile(rb"<([^\s<>/?!][^\s<>/]*)")
# words between more dots than levels, in a key of TOML; each is looked at from its beginning alone
_WORD = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_DEEP_KEY = re.compile(rf"(?<![\w-]){_WORD}(?:[ \t]*+\.[ \t]*+{_WORD}){{{MAX_LEVELS}}}")
_CHUNK_BYTES = 65_536  # bytes of XML, after each of which a refusal ends the reading


def no_file(path: Path) -> str:
    """Return the message about a path that is no file."""
    return f"{path}: is a folder, expected a file" if path.is_dir() else f"{path}: no such file"


@contextmanager
def reading(path: Path | str, kind: str, unreadable: tuple[type[Exception], ...]) -> Iterator[None]:
    """Convert a library's errors over a file, and too deep nesting, into `FileFormatError`, within a `with` block.

    Args:
        path: The file, which opens every message.
        kind: Its format, for the message.
        unreadable: Exceptions by which the library refuses a file.
    """
    try:
        yield
    except FileFormatError:
        raise
    except RecursionError as error:
        raise FileFormatError(f"{path}: is nested more than {MAX_LEVELS} levels deep") from error
    except unreadable as error:
        message = f"{cut(str(error) or repr(error))}{copied_as_text(path)}"
        raise FileFormatError(f"{path}: cannot be read as {kind}: {message}") from error


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Return the bytes of a file within a limit; FileFormatError where it is larger or cannot be read.

    Args:
        path, max_bytes: The file, and its largest size [B].
    """
    try:
        with path.open("rb") as file:
            data = file.read(max_bytes + 1)
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        raise FileFormatError(f"{path}: cannot be read: {error}") from error
    _refuse_length(data, str(path), max_bytes)
    return data


def json_value(data: str | bytes, where: str, *, finite: bool = True) -> Any:
    """Parse JSON text into plain data, within `MAX_JSON_BYTES` and `MAX_LEVELS`.

    Args:
        data, where: Text, or its bytes in UTF-8, and its source, which opens every message.
        finite: Whether NaN and infinity, which JSON does not know and Python writes, are refused.

    Raises:
        FileFormatError: No JSON, beyond the limits, a key twice in a table, a number beyond a float64, or an integer
            beyond 2^128.
    """
    text = _text_of(data, where, "JSON", MAX_JSON_BYTES)

    def table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        content = dict(pairs)
        if len(content) < len(pairs):
            twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
            raise FileFormatError(f"{where}: key {shortened(twice)} is twice in one table, expected once")
        return content

    def constant(name: str) -> float:
        if finite:
            raise FileFormatError(f"{where}: {_place(text, name)}holds {name}, expected a finite number")
        return float(name)

    def real(digits: str) -> float:
        return _real(digits, text, where)

    # no JSON, an integer of thousands of digits, half a character (a lone surrogate)
    with reading(where, "JSON", (ValueError,)):
        content = json.loads(text, object_pairs_hook=table, parse_constant=constant, parse_float=real)
        _refuse_depth(content, where)
        if "\\u" in text:
            json.dumps(content, ensure_ascii=False).encode()
    return content


def json_table(data: str | bytes, where: str, *, finite: bool = True) -> dict[str, Any]:
    """Parse JSON text that holds a table, {"key": value, ...}.

    Args:
        data, where: Text, or its bytes in UTF-8, and its source, which opens every message.
        finite: Whether NaN and infinity are refused.
    """
    content = json_value(data, where, finite=finite)
    if not isinstance(content, dict):
        raise FileFormatError(f"{where}: holds {shortened(content)}, expected a table (a JSON object)")
    return content


def without_comments(data: bytes) -> bytes:
    """Return JSON without the comments of JavaScript that the dVRK's files have; lines keep their numbers."""

    def blank(match: re.Match[bytes]) -> bytes:
        return match[0] if match[0].startswith(b'"') else b" " + b"\n" * match[0].count(b"\n")

    return _TEXT_OR_COMMENT.sub(blank, data)


def toml_table(data: str | bytes, where: str) -> dict[str, Any]:
    """Parse TOML text into plain data, within `MAX_TOML_BYTES`, `MAX_LEVELS` and float64; else FileFormatError.

    Args:
        data, where: Text, or its bytes in UTF-8, and its source, which opens every message.
    """
    text = _text_of(data, where, "TOML", MAX_TOML_BYTES)
    if _DEEP_KEY.search(text):  # of which tomllib makes every part that a key begins with
        raise FileFormatError(f"{where}: is nested more than {MAX_LEVELS} levels deep")
    with reading(where, "TOML", (ValueError,)):
        content = tomllib.loads(text, parse_float=lambda digits: _real(digits, text, where))
    _refuse_depth(content, where)
    return content


def xml_tree(data: str | bytes, where: str) -> Element:
    """Parse XML text into its root element, within `MAX_XML_BYTES` and `_MAX_ELEMENTS`.

    Names keep their prefix and `xmlns` is an attribute like any other, as in TinyXML, which other programs read URDF
    and MJCF with: a prefix need not be declared.

    Args:
        data, where: Text, or its bytes, and its source, which opens every message.

    Raises:
        FileFormatError: No XML, beyond the limits, or with entities of its own, which can stand for other files and for
            gigabytes.
    """
    _refuse_length(data, where, MAX_XML_BYTES)
    builder, parser, numbers = TreeBuilder(), expat.ParserCreate(), count(1)

    def refuse(what: str) -> None:
        raise FileFormatError(f"{where}: line {parser.CurrentLineNumber}: {what}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        if next(numbers) > _MAX_ELEMENTS:
            refuse(f"more than {_MAX_ELEMENTS} elements, the most that are read of such a file")
        builder.start(tag, attributes)

    def entity(name: str, *_: object) -> None:
        refuse(f"entity {shortened(name)}: expected none but XML's own; write what it stands for")

    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = parser.SkippedEntityHandler = entity
    with reading(where, "XML", (expat.ExpatError, LookupError, ValueError)):  # LookupError: no such encoding
        for begin in range(0, len(data), _CHUNK_BYTES):
            parser.Parse(data[begin : begin + _CHUNK_BYTES], False)
        parser.Parse(b"", True)
    return builder.close()


def plain_number(text: str) -> float:
    """Return the number that a text is to XML as well; ValueError of 1_000, and of digits of other scripts."""
    if not text.isascii() or "_" in text:
        raise ValueError(f"{shortened(text)} is no number")
    return float(text)


def xml_root_tag(data: str | bytes, where: str) -> str:
    """Return the name of the root element of XML text, without parsing the rest.

    Args:
        data, where: Text, or its bytes, and its source, which opens every message.
    """
    _refuse_length(data, where, MAX_XML_BYTES)
    match = _ROOT_TAG.search(XML_COMMENT.sub(b"", data.encode() if isinstance(data, str) else data))
    return match[1].decode(errors="replace") if match else xml_tree(data, where).tag


def shortened(value: Any) -> str:
    """Return a value as an error repeats it, at most `_MAX_CHARACTERS` characters."""
    if isinstance(value, int) and abs(value) >= _MAX_INTEGER:
        return "a huge integer"  # Python refuses to print what has more than 4300 digits
    return cut(repr(value))


def cut(text: str) -> str:
    """Return a text of at most `_MAX_CHARACTERS` characters, its beginning."""
    return text if len(text) <= _MAX_CHARACTERS else f"{text[:_MAX_CHARACTERS]}... ({len(text)} characters)"


def _text_of(data: str | bytes, where: str, kind: str, max_bytes: int) -> str:
    _refuse_length(data, where, max_bytes)
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError(f"{where}: cannot be read as {kind}: is UTF-16, expected UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        place = f"byte {error.start}"
        raise FileFormatError(f"{where}: cannot be read as {kind}: {place}: is no UTF-8 text") from error


def _refuse_length(data: str | bytes, where: str, max_bytes: int) -> None:
    if len(data) > max_bytes:
        raise FileFormatError(f"{where}: is longer than {max_bytes} bytes, the most that is read of such a file")


def _refuse_depth(content: Any, where: str) -> None:
    """Refuse what is nested too deep, level by level, and integers that tomllib took however long they are."""
    level = [content]
    for _ in range(MAX_LEVELS + 1):
        inner = [one for one in level if isinstance(one, dict | list)]
        if not inner:
            return
        level = [value for one in inner for value in (one.values() if isinstance(one, dict) else one)]
        if any(type(value) is int and abs(value) >= _MAX_INTEGER for value in level):
            raise FileFormatError(f"{where}: holds a huge integer, expected less than 2^128")
    raise FileFormatError(f"{where}: is nested more than {MAX_LEVELS} levels deep")


def _real(digits: str, text: str, where: str) -> float:
    value = float(digits)
    if math.isinf(value) and not digits.endswith("inf"):  # TOML may say inf; a schema may take it
        raise FileFormatError(f"{where}: {_place(text, digits)}number {cut(digits)}: expected at most 1.8e308")
    return value


def _place(text: str, literal: str) -> str:
    at = text.find(literal)
    return f"line {text.count(chr(10), 0, at) + 1}: " if at >= 0 else ""
