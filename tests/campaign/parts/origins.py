"""Requests of strangers to a page of the view that runs, and messages of whoever knows its address, of any content.

Held is that nothing is served or accepted without this run's token, under a foreign name or for a foreign page; that
what the page tells of its controls is what they may have; and that the page goes on for who comes by its address.
"""

import functools
import math
import socket
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import numpy as np

from patience import until
from tests.campaign.part import Fell, Part

if TYPE_CHECKING:
    from catenary.view.page_process import PageProcess

OF_A_CASE = 20
PATIENCE = 60.0  # [s]
NAMES = ("127.0.0.1", "localhost")
FOREIGN = (
    "evil.example", "evil.example:PORT", "127.0.0.1.evil.example:PORT", "127.0.0.2:PORT", "localhost.:PORT", "[::1]:PORT",
    "0.0.0.0:PORT", "2130706433:PORT", "127.1:PORT", "user@127.0.0.1:PORT", "127.0.0.1:PORT.", "127.0.0.1:PORT/", "", ":PORT",
)  # fmt: skip
METHODS = ("POST", "HEAD", "PUT", "OPTIONS", "CONNECT", "DELETE", "get", "G", "", "\x00")
UPGRADE = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: Y2F0ZW5hcnksIGEga2V5IQ==\r\n"


@functools.cache
def _page() -> "PageProcess":
    from view.connected import page_of_an_arm

    opened = page_of_an_arm(18600)
    _page.opened = opened  # type: ignore[attr-defined]  # kept open until the process ends
    return opened.__enter__()


def strangers(seed: int, folder: Path) -> None:
    """Ask a page for whatever, by any method, path, name, origin and token; then come by its address."""
    rng = np.random.default_rng(seed)
    page = _page()
    page.changes()
    place = urlsplit(page.url)
    with (folder / "input").open("wb") as file:
        for _ in range(OF_A_CASE):
            request, allowed = _request(rng, place.path.strip("/"), place.port or 0)
            file.write(request + b"\n----\n")
            file.flush()
            answer = _answer(place.port or 0, request, ends=allowed is None or b"\r\n\r\n" not in request)
            served = b"<html" in answer or answer[:12] in (b"HTTP/1.1 200", b"HTTP/1.1 101")
            if served and allowed is False:
                raise Fell(f"{request!r} was answered {answer[:200]!r}")
            if allowed is True and not served:
                raise Fell(f"{request!r}, which may, was answered {answer[:200]!r}")
    if changed := page.changes():
        raise Fell(f"strangers changed {changed}")
    _require_alive(page)


def _request(rng: np.random.Generator, token: str, port: int) -> tuple[bytes, bool | None]:
    """Draw a request, and whether it may be served; None where neither is promised."""
    path, knows = _path(rng, token)
    hosts, own = _hosts(rng, port)
    origins, same = _origins(rng, hosts[0] if hosts else "", port)
    method = "GET" if rng.random() < 0.85 else str(rng.choice(METHODS))
    version = "HTTP/1.1" if rng.random() < 0.95 else str(rng.choice(["HTTP/1.0", "HTTP/2", "http/1.1", ""]))
    headers = [f"{_cased(rng, 'Host')}: {host}" for host in hosts]
    headers += [f"{_cased(rng, 'Origin')}: {origin}" for origin in origins]
    for _ in range(int(rng.integers(3))):
        name = str(rng.choice(["Referer", "Cookie", "X-Forwarded-Host", "X-Forwarded-For", "Forwarded", "Accept"]))
        headers.append(f"{name}: {rng.choice(['127.0.0.1', 'http://127.0.0.1', 'host=localhost', '*/*'])}")
    lines = [headers[k] for k in rng.permutation(len(headers))]
    text = f"{method} {path} {version}\r\n" + "".join(f"{line}\r\n" for line in lines)
    text += (UPGRADE if rng.random() < 0.5 else "") + "\r\n"
    request = text.encode("utf-8", "surrogateescape")
    well_formed = method == "GET" and version == "HTTP/1.1"
    if rng.random() < 0.2:  # any bytes of it are others, or it ends early
        damaged = bytearray(request)
        for _ in range(int(rng.integers(1, 6))):
            damaged[int(rng.integers(len(damaged)))] = int(rng.integers(256))
        request = bytes(damaged[: int(rng.integers(1, len(damaged) + 1))])
        return request, False if token.encode() not in request else None
    return request, bool(knows and own and same and well_formed)


def _path(rng: np.random.Generator, token: str) -> tuple[str, bool]:
    k, other = int(rng.integers(len(token))), str(rng.choice(list("abcXYZ019-_.~%")))
    if other == token[k]:
        other = "!"
    with_token = (f"/{token}/", f"/{token}", f"/{token}/index.html", f"/{token}/?darkMode", f"/{token}?x=/")
    without = (
        "/", "/index.html", "//", "*", "", "/favicon.ico", f"/?{token}", f"/?token={token}", f"/#{token}", f"/x/{token}/",
        f"/../{token}/", f"/./{token}/", f"//{token}/", f"/{token[:k]}/", f"/{token}{other}/", f"/{token[:k]}{other}{token[k + 1 :]}/",
        f"/{token[:k]}%{ord(token[k]):02X}{token[k + 1 :]}/", f"/{token.swapcase()}/", f"/{token[::-1]}/", f"/{token}%2f", f"/{token};/",
        f"http://127.0.0.1/{token}/", f"/{token[:k]}\x00{token[k:]}/", f"/{'A' * len(token)}/", f"/{token}\udcff/", "/" + "a" * 5000,
    )  # fmt: skip
    if rng.random() < 0.4:
        return str(rng.choice(with_token)), True
    return without[int(rng.integers(len(without)))], False


def _hosts(rng: np.random.Generator, port: int) -> tuple[list[str], bool]:
    own = f"{rng.choice(NAMES)}:{port}"
    foreign = str(rng.choice(FOREIGN)).replace("PORT", str(port))
    drawn = rng.random()
    if drawn < 0.6:
        return [own], True
    if drawn < 0.85:
        return [foreign], False
    return ([], [own, own], [own, foreign], [foreign, own])[int(rng.integers(4))], False


def _origins(rng: np.random.Generator, host: str, port: int) -> tuple[list[str], bool]:
    own = f"http://{host}"
    foreign = str(
        rng.choice([*(f"http://{name}" for name in FOREIGN), "null", f"https://{host}", f"{own}/", f"{own}.evil.example",
                    "http://127.0.0.1", f"http://127.0.0.1:{port + 1}", "file://", "", host])
    ).replace("PORT", str(port))  # fmt: skip
    drawn = rng.random()
    if drawn < 0.35:
        return [], True
    if drawn < 0.6:
        return [own], True
    if drawn < 0.85:
        return [foreign], foreign == own
    return ([own, own], [own, foreign], [foreign, own])[int(rng.integers(3))], False


def _cased(rng: np.random.Generator, name: str) -> str:
    return str(rng.choice([name, name.lower(), name.upper()]))


def _answer(port: int, request: bytes, *, ends: bool = False) -> bytes:
    """Return what comes to a request until the server closes or says that a WebSocket is open; `ends` says no more."""
    found = b""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        try:
            connection.sendall(request)
            if ends:
                connection.shutdown(socket.SHUT_WR)
            while len(found) < 4096 and not (found.startswith(b"HTTP/1.1 101") and b"\r\n\r\n" in found):
                if not (piece := connection.recv(65536)):
                    break
                found += piece
        except ConnectionError:  # closed while more was sent to it
            pass
    return found


def _require_alive(page: "PageProcess") -> None:
    """Who comes by the page's address is served, and let in, whatever was before."""
    from view.connected import connect

    place = urlsplit(page.url)
    answer = _answer(place.port or 0, f"GET {place.path} HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
    if not answer.startswith(b"HTTP/1.1 200") or b"<html" not in answer:
        raise Fell(f"the page is no longer served: {answer[:200]!r}")
    with connect(page.url, origin=f"http://{place.netloc}") as client:
        client.recv(timeout=PATIENCE)
    if not page.is_running:
        raise Fell("the page's process ended")


def messages(seed: int, folder: Path) -> None:
    """Send whatever as one who knows the address; what is told is what the controls may have, and the page goes on."""
    from catenary.view.shown import NOBODY
    from view.connected import Connected, connect, shown_arm

    rng = np.random.default_rng([seed, 1])
    page = _page()
    page.changes()
    known = {control.name: control for tab in shown_arm().tabs for control in tab.controls}
    options = [option for control in known.values() for option in getattr(control, "options", ())]
    told: list[Any] = []
    with (folder / "input").open("w") as file, Connected(page.url) as looking, connect(page.url) as other:
        # of two values at the same time the later may be put back with the earlier, so the last one has its own control
        labels = sorted({control.label for control in known.values()} - {"rocking [Hz]"})
        for _ in range(OF_A_CASE):
            label, value = str(rng.choice(labels)), _value(rng, options)
            print(label, repr(value), file=file, flush=True)
            looking.set(label, value)
        data = rng.bytes(int(rng.integers(1, 200)))
        print(data.hex(), file=file, flush=True)
        other.send(data if rng.random() < 0.8 else data.hex())
        marker = float(rng.uniform(0.1, 2.0))
        looking.set("rocking [Hz]", marker)
        until(lambda: told.extend(page.changes()) or ("rocking_hz", marker) in told)
    for name, value in told:
        if name != NOBODY.name and not _is_possible(known[name], value):
            raise Fell(f"{name}: told {value!r}")
    _require_alive(page)


def _value(rng: np.random.Generator, options: list[str]) -> object:
    number = float(rng.normal() * 10.0 ** rng.integers(-3, 300))
    odd = (math.nan, math.inf, -math.inf, 1e308, -0.0, 2**63 - 1, -(2**63), True, False, None, "", "nan", "-inf", "1e9", [], {},
           [1.0], {"value": 1.0}, b"\xff", "a" * 10_000, "\u0663", "None")  # fmt: skip
    return (number, str(number), str(rng.choice(options)), odd[int(rng.integers(len(odd)))])[int(rng.integers(4))]


def _is_possible(control: Any, value: object) -> bool:
    if hasattr(control, "low"):
        return isinstance(value, float) and control.low <= value <= control.high
    return value in control.options if hasattr(control, "options") else value in (True, False)


PARTS = (
    # the page's process inherits limits of time and memory, and outlives a case
    Part("origins.strangers", 1000, strangers, processor_time=math.inf, memory=None),
    Part("origins.messages", 500, messages, processor_time=math.inf, memory=None),
)
