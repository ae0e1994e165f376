"""What browsers set on a page, as the program behind it is told."""

import http.client
import threading
from collections.abc import Iterator
from contextlib import closing
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import numpy as np
import pytest

from catenary.errors import CatenaryError
from catenary.view.meshes import arm_shapes
from catenary.view.page_content import Change, PageContent
from catenary.view.page_process import PageProcess
from catenary.view.viser_page import gravity_html, joints_html, open_server, status_html
from patience import PATIENCE, until
from view.arms import RAVEN, Q, state
from view.connected import Connected, connect, page_of_an_arm

pytest.importorskip("viser")


@pytest.fixture(scope="module")
def page() -> Iterator[PageProcess]:
    with page_of_an_arm(18530) as opened:
        yield opened


@pytest.fixture(scope="module")
def browsers(page: PageProcess) -> Iterator[tuple[Connected, Connected]]:
    """Two that look; what the one does the other sees."""
    with Connected(page.url) as looking, Connected(page.url) as other:
        yield looking, other


# what a browser makes of a control, and what is told of it (None of a value that is put back); `accepted` has its own
VALUES = [
    ("payload [kg]", 1e9, Change("payload_kg", 1.0)),
    ("payload [kg]", float("nan"), None),
    ("payload [kg]", "heavy", None),
    ("joint0 [deg]", -1e6, Change("goto:joint0", -180.0)),
    ("motion", "explode", None),
    ("motion", "zig-zag", Change("motion", "zig-zag")),
    ("run level", "pause", Change("level", "pause")),
    ("use the model in the loop", "on", Change("model", True)),
]


@pytest.mark.parametrize(("label", "value", "expected"), VALUES)
def test_value_that_a_control_cannot_have_is_bounded_or_put_back_and_never_told(
    page: PageProcess, browsers: tuple[Connected, Connected], label: str, value: object, expected: Change | None
) -> None:
    looking, other = browsers
    page.changes()
    before, seen = other.values[label], other.values["rocking [Hz]"]
    looking.set(label, value)
    marker = 1.5 if seen != 1.5 else 1.0
    looking.set("rocking [Hz]", marker)  # is told after it
    found: list[Change] = []
    until(lambda: found.extend(page.changes()) or {"rocking_hz"} <= {name for name, _ in found})
    until(lambda: found.extend(page.changes()) or expected is None or expected in found)
    assert {change for change in found if change.name != "rocking_hz"} == {expected} - {None}
    other.wait(lambda: other.values["rocking [Hz]"] == marker)  # by then it was sent what was asked for
    if label != "run level":  # buttons show nothing
        other.wait(lambda: other.values[label] == (before if expected is None else expected.value))


def test_joints_are_told_in_degrees_and_millimetres_with_their_interval() -> None:
    legend = {"reported": "reported", "calibrated": "calibrated"}
    shown = PageContent("x", RAVEN, arm_shapes(RAVEN), legend=legend)
    told = joints_html(shown, state(calibrated=Q, interval=np.full(3, 0.001), inside=np.array([True, True, False])))
    assert "400.00 \u00b1 1.00?" in told
    assert "40.11" in told  # 0.7 rad


def test_what_comes_from_a_file_is_text_and_no_markup() -> None:
    told = status_html(state(doing="<script>alert(1)</script>", notes=("<img src=x onerror=y>",)))
    assert "<script" not in told
    assert "<img" not in told


def test_gravity_is_told_with_the_angle_between_measured_and_assumed() -> None:
    down, side = np.array([0.0, 0.0, -9.81]), np.array([0.0, 9.81, 0.0])
    told = gravity_html(state(gravity=side, assumed=down, gravity_age=0.004))
    assert "90.0 deg apart" in told
    assert "4 ms ago" in told


pytest.importorskip("viser")


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    with page_of_an_arm(18500) as page:
        yield page.url


def get(url: str, path: str | None = None, **headers: str) -> http.client.HTTPResponse:
    """Ask for a path, by default the page's own; headers of http.client's own are replaced."""
    place = urlsplit(url)
    with closing(http.client.HTTPConnection(place.hostname or "", place.port, timeout=PATIENCE)) as connection:
        connection.putrequest("GET", path or place.path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        response = connection.getresponse()
        response.page = response.read()  # type: ignore[attr-defined]
        return response


def accepts(url: str, **options: object) -> bool:
    """Whether a WebSocket is accepted; refused is 403 and nothing else."""
    from websockets.exceptions import InvalidStatus

    try:
        with connect(url, **options):
            return True
    except InvalidStatus as error:
        if error.response.status_code != 403:
            raise
        return False


def root(url: str) -> str:
    place = urlsplit(url)
    return f"{place.scheme}://{place.netloc}"


def test_address_of_each_run_holds_another_secret(url: str) -> None:
    server, other = open_server(18510)
    server.stop()
    tokens = {urlsplit(one).path.strip("/") for one in (url, other)}
    assert len(tokens) == 2
    assert all(len(token) >= 22 for token in tokens)  # 128 bits


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_page_is_served_at_its_own_address(url: str, name: str) -> None:
    port = urlsplit(url).port
    for path in (urlsplit(url).path, urlsplit(url).path.rstrip("/"), f"{urlsplit(url).path}index.html?x=1"):
        answer = get(url, path, Host=f"{name}:{port}")
        assert answer.status == 200
        assert b"<html" in answer.page  # type: ignore[attr-defined]
    assert accepts(url.replace("127.0.0.1", name))


def test_page_is_served_through_a_tunnel_that_begins_at_another_port(url: str) -> None:
    assert get(url, Host="localhost:9000", Origin="http://localhost:9000").status == 200


def test_page_keeps_its_address_out_of_caches_referrers_and_frames(url: str) -> None:
    for answer in (get(url), get(url, "/")):
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["X-Frame-Options"] == "DENY"


@pytest.mark.parametrize(
    "path",
    ["/", "/index.html", "//", "/?TOKEN", "/wrong/", "/SHORT/", "/LONG/", "/%TOKEN/", "/x/TOKEN/", "//TOKEN/",
     "/../TOKEN/", "/token/", "/TOKEN%2f", "/\xe9/", "*", "http://127.0.0.1/index.html", "/favicon.ico"],
)  # fmt: skip
def test_nothing_is_served_or_accepted_without_the_token(url: str, path: str) -> None:
    token = urlsplit(url).path.strip("/")
    for name, other in (
        ("%TOKEN", f"%{ord(token[0]):02x}{token[1:]}"),
        ("SHORT", token[:-1]),
        ("LONG", f"{token}x"),
        ("token", token.swapcase()),
        ("TOKEN", token),
    ):
        path = path.replace(name, other)
    # as it stands, which http.client does not send
    answer = said(url, f"GET {path} HTTP/1.1\r\nHost: {urlsplit(url).netloc}\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 403 ")
    assert b"<html" not in answer
    upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: Y2F0ZW5hcnksIGEga2V5IQ=="
    answer = said(url, f"GET {path} HTTP/1.1\r\nHost: {urlsplit(url).netloc}\r\n{upgrade}\r\n\r\n")
    assert answer.startswith(b"HTTP/1.1 403 ")


def said(url: str, request: str) -> bytes:
    """What the server says to a request of any form, until it closes."""
    import socket

    place = urlsplit(url)
    with socket.create_connection((place.hostname or "", place.port or 0), timeout=PATIENCE) as connection:
        connection.sendall(request.encode("latin-1"))
        found = b""
        while piece := connection.recv(65536):
            found += piece
        return found


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:PORT", "127.0.0.1.evil.example:PORT", "localhost.evil.example:PORT", "192.168.0.7:PORT",
     "127.0.0.1:PORT.evil.example", "evil.example@127.0.0.1:PORT", "127.0.0.2:PORT", "0.0.0.0:PORT", "", "127.0.0.1:PORT, evil.example"],
)  # fmt: skip
def test_another_name_of_this_machine_is_refused_even_with_the_token(url: str, host: str) -> None:
    host = host.replace("PORT", str(urlsplit(url).port))
    assert get(url, Host=host).status == 403
    request = f"GET {urlsplit(url).path} HTTP/1.1\r\nHost: {urlsplit(url).netloc}\r\nHost: {host}\r\n\r\n"
    assert said(url, request).startswith(b"HTTP/1.1 403 ")
    assert said(url, f"GET {urlsplit(url).path} HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 403 ")


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "https://OWN", "http://127.0.0.1", "http://127.0.0.1:1", "http://localhost:PORT",
     "http://OWN.evil.example", "http://OWN/", "", "file://", "HTTP://OWN"],
)  # fmt: skip
def test_another_pages_request_is_refused_even_with_the_token(url: str, origin: str) -> None:
    own = urlsplit(url).netloc
    origin = origin.replace("OWN", own).replace("PORT", str(urlsplit(url).port))
    assert get(url, Origin=origin).status == 403
    assert not accepts(url, additional_headers={"Origin": origin})
    assert not accepts(url, additional_headers=[("Origin", root(url)), ("Origin", origin)])


def test_websocket_wants_the_token_and_takes_its_own_page_or_none(url: str) -> None:
    assert accepts(url, origin=root(url))
    assert accepts(url)
    assert not accepts(root(url), origin=root(url))
    assert not accepts(root(url))
    assert not accepts(f"{root(url)}/wrong", origin=root(url))
    assert not accepts(url, origin="http://evil.example")


@pytest.mark.parametrize(("page", "websocket"), [(200, 101), (403, 101), (200, 403), (403, 403)])
def test_viser_that_opens_its_server_in_another_way_is_refused(
    monkeypatch: pytest.MonkeyPatch, page: int, websocket: int
) -> None:
    import viser

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(websocket if "Upgrade" in self.headers else page)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    class LaterViser:
        def __init__(self, **_: object) -> None:
            self.get_port = lambda: server.server_port

    monkeypatch.setattr(viser, "ViserServer", LaterViser)
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with pytest.raises(CatenaryError, match=r"let in strangers .*pip install 'viser<"):
            open_server(18520)
        server.shutdown()
