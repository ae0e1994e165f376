"""Spoilt JSON, TOML and XML: values of other kinds, huge and odd ones, keys and elements that come, go and move."""

import json
import random
from collections.abc import Callable
from copy import deepcopy
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape


class Raw(str):
    """Text that is written as it is, where a value is expected."""


class Pairs(list[list[Any]]):
    """A table as its keys and values, in which a key may be twice."""


DEEP: Any = [[[[[[[[1]]]]]]]]
ODD: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 3.5, -0.0, 1e-320, 1e6, 1e20, 1e300, 1.7e308, -1e308, 2**31, 2**63, 2**64, -(2**63),
    10**40, Raw("NaN"), Raw("nan"), Raw("inf"), Raw("-inf"), Raw("Infinity"), Raw("1e999"), Raw("-"), Raw("9" * 5000),
    Raw("0." + "9" * 5000), Raw("0x" + "f" * 3000), Raw("[" * 5000), Raw("2020-01-01"), Raw("'''"), Raw(""),
    "", "x", "NaN", "rad", "base", "../../etc/passwd", "/dev/zero", "a" * 20_000, "\0", "\x1b[2J", "\u202e", "\ud800",
    "é", "\n", '"', "a.b", [], {}, [[]], [{}], DEEP, [1] * 3, [1] * 5000, ["a"] * 7, {"a": 1}, {"name": 3}, Raw("[" * 90 + "]" * 90),
)  # fmt: skip
KEYS = ("", "name", "x", "é", "a.b", "a" * 5000, "\0", "\x1b[2J", "format", "mass_kg", "__class__", "0")


def spoilt_table(rng: random.Random, content: Any, write: Callable[[Any], str]) -> bytes:
    """Return a table's text with one to four changes, and sometimes some bytes of it."""
    tree = _pairs(deepcopy(content))
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        _spoil(rng, tree)
    data = write(tree).encode("utf-8", "surrogatepass")
    return spoilt_bytes(rng, data) if rng.random() < 0.2 else data


def spoilt_bytes(rng: random.Random, data: bytes) -> bytes:
    """Return data with bytes changed, cut, doubled, or in front of it."""
    kind = rng.randrange(7)
    at = rng.randrange(len(data) + 1)
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9))) + data[at:]
    if kind == 2:
        return data[:at] + data[at + rng.randrange(1, 40) :]
    if kind == 3:
        return rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\0", b"#", b"[" * 3000)) + data
    if kind == 4:
        return data.decode("utf-8", "replace").encode(rng.choice(("utf-16", "utf-32", "latin-1", "cp037")), "replace")
    if kind == 5:
        piece = data[at : at + rng.randrange(1, 200)]
        return data[:at] + piece * rng.randrange(2, 50) + data[at:]
    changed = bytearray(data)
    for _ in range(rng.randrange(1, 6)):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _pairs(value: Any) -> Any:
    if isinstance(value, dict):
        return Pairs([key, _pairs(inner)] for key, inner in value.items())
    return [_pairs(inner) for inner in value] if isinstance(value, list | tuple) else value


def _places(tree: Any) -> list[tuple[list[Any], int]]:
    """Return every (container, index) that holds a value; a pair of a table holds its own at 1."""
    found, waiting = [], [tree]
    while waiting:
        here = waiting.pop()
        inner = [(pair, 1) for pair in here] if isinstance(here, Pairs) else [(here, i) for i in range(len(here))]
        found += inner
        waiting += [holder[i] for holder, i in inner if isinstance(holder[i], list)]
    return found


def _spoil(rng: random.Random, tree: Any) -> None:
    places = _places(tree)
    if not places:
        return
    holder, i = rng.choice(places)
    tables = [tree, *(h[k] for h, k in places)]
    table = rng.choice([t for t in tables if isinstance(t, Pairs)] or [Pairs()])
    kind = rng.randrange(11)
    if kind <= 3:
        holder[i] = _pairs(deepcopy(rng.choice(ODD)))
    elif kind == 4 and table:
        table.pop(rng.randrange(len(table)))
    elif kind == 5 and table:
        table.append(deepcopy(rng.choice(table)))  # a key twice
    elif kind == 6:
        table.append([rng.choice(KEYS), _pairs(deepcopy(rng.choice(ODD)))])
    elif kind == 7 and table:
        rng.choice(table)[0] = rng.choice((*KEYS, *(pair[0] for pair in table)))
    elif kind == 8:
        other, k = rng.choice(places)
        holder[i], other[k] = deepcopy(other[k]), deepcopy(holder[i])
    elif kind == 9:
        holder[i] = [holder[i]] * rng.choice((1, 2, 50))
    elif isinstance(holder[i], list) and holder[i]:
        rows = holder[i]
        rng.choice((rows.pop, lambda: rows.append(deepcopy(rows[0])), rows.reverse, rows.clear))()
    elif isinstance(holder[i], int | float) and not isinstance(holder[i], bool):
        holder[i] = holder[i] * rng.choice((-1, 0, 1e3, 1e9, 1e200, 1e-9))


def json_of(value: Any) -> str:
    """Return what `spoilt_table` made as JSON."""
    return _text_of(value, ": ", json.dumps)


def toml_of(value: Any) -> str:
    """Return what `spoilt_table` made as TOML, inner tables on one line."""
    return "".join(f"{_toml_text(key)} = {_text_of(inner, ' = ', _toml_text)}\n" for key, inner in value)


def _text_of(value: Any, sign: str, quoted: Callable[[str], str]) -> str:
    """Return a value as text; `sign` stands between key and value of a table."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, Pairs):
        pairs = (f"{quoted(key)}{sign}{_text_of(inner, sign, quoted)}" for key, inner in value)
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_text_of(inner, sign, quoted) for inner in value) + "]"
    return quoted(value) if isinstance(value, str) else json.dumps(value)


def _toml_text(text: str) -> str:
    return json.dumps(text).replace("\\ud800", "\ud800")


TEXTS = (
    "", "x", "nan", "inf", "-inf", "1e999", "1e308", "-1e308", "1e-320", "0", "-1", "0 0 0", "1 2", "1e6 0 0", "nan nan nan",
    "9" * 5000, "a" * 20_000, "true", "../../etc/passwd", "/dev/zero", "robot.xml", "\x1b", "é", "${x}", "1,2,3", "1 2 3 4 5 6 7",
    "100000", "-5", "4294967296", "1e9", "hinge", "ball", "free", "floating", "mesh", "base", "world",
)  # fmt: skip
ATTRIBUTES = (
    "name",
    "type",
    "pos",
    "size",
    "count",
    "file",
    "class",
    "mass",
    "xyz",
    "rpy",
    "range",
    "x" * 3000,
    "nrow",
)
BOMB = '<!DOCTYPE a [<!ENTITY a "' + "x" * 1000 + '">' + "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 20}">' for i in range(8)
) + '<!ENTITY x SYSTEM "file:///etc/passwd">]>'  # fmt: skip
PIECES = (
    "<replicate count='{n}'><body><joint/><geom size='1'/></body></replicate>", "<include file='robot.xml'/>",
    "<include file='../robot.xml'/>", "<size nuser_body='{n}' nkey='{n}'/>", "<size memory='{n}'/>", "<body/>", "<joint/>",
    "<asset><hfield name='h' nrow='{n}' ncol='{n}' size='1 1 1 1'/></asset>", "<freejoint/>", "<geom size='{n}'/>",
    "<asset><texture name='t' builtin='flat' width='{n}' height='{n}'/></asset>", "<link name='l{n}'/>", "<inertial/>",
    "<custom><numeric name='a' size='{n}' data='1'/></custom>", "<sensor><user dim='{n}'/></sensor>", "&x;", "&i;",
    "<a>" * 400 + "</a>" * 400, "<b/>" * 20_000, "<mimic joint='j' multiplier='{n}'/>", "<!-- -- -->", "<![CDATA[{n}]]>",
    "<option timestep='{n}' gravity='{n} 0 0'/>", "<compiler inertiafromgeom='true' boundmass='{n}'/>", "<?x {n}?>",
)  # fmt: skip


def spoilt_xml(rng: random.Random, text: str) -> bytes:
    """Return XML with one to four changes, sometimes of bytes, sometimes with entities."""
    root = ElementTree.fromstring(text)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        parents = [element for element in root.iter() if len(element)]
        element = rng.choice(list(root.iter()))
        parent = rng.choice(parents or [root])
        kind = rng.randrange(10)
        if kind <= 3 and element.attrib:
            element.set(rng.choice(list(element.attrib)), rng.choice(TEXTS))
        elif kind == 4:
            element.set(rng.choice(ATTRIBUTES), rng.choice(TEXTS))
        elif kind == 5 and element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        elif kind == 6 and len(parent):
            parent.remove(rng.choice(list(parent)))
        elif kind == 7 and len(parent):
            parent.append(deepcopy(rng.choice(list(parent))))
        elif kind == 8:
            element.append(deepcopy(rng.choice(list(root.iter()))))
        else:
            element.tag = rng.choice(("body", "joint", "link", "geom", "mimic", "x", "robot", "include"))
    written = ElementTree.tostring(root, encoding="unicode")
    if rng.random() < 0.4:
        places = [i for i, letter in enumerate(written) if letter == ">"]
        at = rng.choice(places) + 1
        piece = rng.choice(PIECES).replace("{n}", escape(rng.choice(("0", "-1", "3", "30000", "1e9", "999999999999"))))
        written = written[:at] + piece + written[at:]
    if rng.random() < 0.05:
        many = " ".join(f'a{i}="1"' for i in range(200_000))
        written = written.replace("<", f"<x {many}/><", 1) if rng.random() < 0.5 else f"<robot {many}/>"
    if rng.random() < 0.1:
        written = BOMB + written
    data = written.encode("utf-8", "surrogatepass")
    return spoilt_bytes(rng, data) if rng.random() < 0.2 else data
