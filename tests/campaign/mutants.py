"""Damage by a seed: to bytes, as disks and transfers do, and to the values of JSON, TOML and XML, as people do."""

import json
import random
from collections.abc import Callable
from copy import deepcopy
from typing import Any
from xml.etree import ElementTree

SPECIAL = (0, 1, -1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1, 100, 65_535, 2**20, 2**28)


def mutant(rng: random.Random, content: bytes) -> bytes:
    """Return content with one to three kinds of damage."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        length = min(len(data), rng.choice((1, 2, 4, 8, 16, 64, 256, 1024, 4096, 20_000)))
        at = rng.randrange(len(data) - length + 1)
        block = data[at : at + length]
        to = rng.randrange(len(data) + 1)
        kind = rng.randrange(7)
        if kind == 0 and length:
            for _ in range(rng.choice((1, 1, 2, 8, 64))):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[at : at + length] = rng.choice((bytes(length), b"\xff" * length, rng.randbytes(length)))
        elif kind == 2:
            del data[to:]
        elif kind == 3:
            data[to:to] = rng.randbytes(rng.choice((1, 4, 100, 5000)))
        elif kind == 4:
            data[to:to] = block * rng.choice((1, 1, 2, 20))
        elif kind == 5:
            del data[at : at + length]
        else:  # a length or count, most likely
            size = rng.choice((1, 2, 4, 8))
            now = int.from_bytes(data[at : at + size], "little")
            value = rng.choice((*SPECIAL, now + 1, now - 1, 2 * now, len(data)))
            data[at : at + size] = (value % 2 ** (8 * size)).to_bytes(size, "little")
    return bytes(data)


def same_length(rng: random.Random, data: bytes) -> bytes:
    return (mutant(rng, data) + data)[: len(data)]


class Raw(str):
    """Text that is written as it is, where a value is expected."""


ODD: tuple[Any, ...] = (
    None, True, 0, -1, 2, 3.5, -0.0, 1e-320, 1e20, 1.7e308, 2**63, 2**64, 10**40, Raw("NaN"), Raw("nan"), Raw("inf"),
    Raw("-Infinity"), Raw("1e999"), Raw("9" * 5000), Raw("0x" + "f" * 3000), Raw("[" * 5000), Raw("2020-01-01"), Raw(""),
    "", "x", "rad", "base", "../../etc/passwd", "/dev/zero", "a" * 20_000, "\0", "\x1b[2J", "\u202e", "\ud800", "\n", '"',
    [], {}, [[]], [1] * 3, [1] * 5000, ["a"] * 7, {"a": 1}, [[[[[[[[1]]]]]]]],
)  # fmt: skip
KEYS = ("", "name", "a.b", "a" * 5000, "\0", "\x1b[2J", "format", "mass_kg", "__class__")


def spoilt_table(rng: random.Random, content: Any, *, toml: bool) -> bytes:
    """Return a table as JSON or TOML with one to four changes, and sometimes some bytes of it."""
    tree = deepcopy(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        _spoil(rng, tree)
    inner = (
        [f"{_quoted(key)} = {_text(value, ' = ')}\n" for key, value in tree.items()] if toml else [_text(tree, ": ")]
    )
    data = "".join(inner).encode("utf-8", "surrogatepass")
    return mutant(rng, data) if rng.random() < 0.2 else data


def _spoil(rng: random.Random, tree: dict[str, Any]) -> None:
    places: list[tuple[Any, Any]] = []
    waiting: list[Any] = [tree]
    while waiting:
        here = waiting.pop()
        inner = list(here) if isinstance(here, dict) else list(range(len(here)))
        places += [(here, key) for key in inner]
        waiting += [here[key] for key in inner if isinstance(here[key], dict | list)]
    if not places:
        return
    holder, key = rng.choice(places)
    kind, value = rng.randrange(8), holder[key]
    if kind <= 2:
        holder[key] = deepcopy(rng.choice(ODD))
    elif kind == 3:
        holder.pop(key)
    elif kind == 4 and isinstance(holder, dict):
        holder[rng.choice(KEYS)] = deepcopy(rng.choice(ODD))
    elif kind == 5:
        other, name = rng.choice(places)
        holder[key], other[name] = deepcopy(other[name]), deepcopy(value)
    elif kind == 6:
        holder[key] = [value] * rng.choice((1, 2, 50))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        holder[key] = value * rng.choice((-1, 0, 1e3, 1e9, 1e200, 1e-9))


def _text(value: Any, sign: str) -> str:
    """Return a value as text; `sign` stands between key and value of a table."""
    if isinstance(value, Raw):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)}{sign}{_text(inner, sign)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_text(inner, sign) for inner in value) + "]"
    return _quoted(value) if isinstance(value, str) else json.dumps(value)


def _quoted(text: str) -> str:
    return json.dumps(text).replace("\\ud800", "\ud800")  # which TOML has no escape for


TEXTS = (
    "", "x", "nan", "inf", "1e999", "1e308", "1e-320", "0", "-1", "0 0 0", "1 2", "nan nan nan", "9" * 5000, "a" * 20_000,
    "../../etc/passwd", "/dev/zero", "robot.xml", "\x1b", "${x}", "1,2,3", "1_000", "\u0661", "1e200 1e200 0", "1 2 3 4 5 6 7", "100000", "1e9", "ball", "base",
)  # fmt: skip
BOMB = '<!DOCTYPE a [<!ENTITY a "' + "x" * 1000 + '">' + "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 20}">' for i in range(8)
) + '<!ENTITY x SYSTEM "file:///etc/passwd">]>'  # fmt: skip
PIECES = (
    "<replicate count='{n}'><body><joint/><geom size='1'/></body></replicate>", "<include file='robot.xml'/>", "&x;", "&i;",
    "<include file='../robot.xml'/>", "<size nuser_body='{n}' nkey='{n}'/>", "<body/>", "<joint/>", "<freejoint/>",
    "<asset><hfield name='h' nrow='{n}' ncol='{n}' size='1 1 1 1'/></asset>", "<link name='l{n}'/>", "<inertial/>",
    "<a>" * 400 + "</a>" * 400, "<b/>" * 20_000, "<mimic joint='j' multiplier='{n}'/>", "<!-- -- -->",
)  # fmt: skip


def spoilt_xml(rng: random.Random, text: str) -> bytes:
    """Return XML with one to four changes, sometimes of bytes, sometimes with entities."""
    root = ElementTree.fromstring(text)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        elements = list(root.iter())
        element, parent = rng.choice(elements), rng.choice([e for e in elements if len(e)])
        changes: tuple[Callable[[], object], ...] = (
            lambda element=element: element.set(rng.choice([*element.attrib, "name", "type", "size"]), rng.choice(TEXTS)),
            lambda element=element: element.attrib.popitem() if element.attrib else None,
            lambda parent=parent: parent.remove(rng.choice(list(parent))),
            lambda parent=parent: parent.append(deepcopy(rng.choice(list(parent)))),
            lambda element=element: setattr(element, "tag", rng.choice(("body", "joint", "link", "mimic", "robot"))),
        )  # fmt: skip
        rng.choice((*changes[:1] * 4, *changes[1:]))()
    written = ElementTree.tostring(root, encoding="unicode")
    if rng.random() < 0.4:
        at = rng.choice([i for i, letter in enumerate(written) if letter == ">"]) + 1
        piece = rng.choice(PIECES).replace("{n}", rng.choice(("0", "-1", "3", "30000", "1e9", "999999999999")))
        written = written[:at] + piece + written[at:]
    data = ((BOMB if rng.random() < 0.1 else "") + written).encode("utf-8", "surrogatepass")
    return mutant(rng, data) if rng.random() < 0.2 else data
