"""Other pages in Chromium, and names that resolve to this machine, reach nothing; the page's own address does."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

import pytest

from catenary.view.page_process import PageProcess
from catenary.view.shown import Change
from view.browser import PATIENCE, SIZE, LookedAtPage, looked_at_empty
from view.connected import page_of_an_arm

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

EVIL = "--host-resolver-rules=MAP evil.example 127.0.0.1"
# what a page gets that opens a WebSocket there as viser's own page does: "open" or "refused"
SOCKET = """([address, protocol]) => new Promise(tell => {
    const socket = new WebSocket(address, [protocol]);
    socket.onopen = () => tell("open"); socket.onerror = () => tell("refused");
})"""
FETCH = "address => fetch(address, {mode: 'no-cors', cache: 'no-store'}).then(() => 'asked', () => 'failed')"
FRAME = """address => new Promise(tell => {
    const frame = document.createElement("iframe");
    frame.onload = () => tell("loaded"); frame.src = address; document.body.append(frame);
})"""


@pytest.fixture(scope="module")
def page() -> Iterator[PageProcess]:
    with page_of_an_arm(18540) as opened:
        yield opened


@pytest.fixture(scope="module")
def browser() -> Iterator[LookedAtPage]:
    with looked_at_empty(SIZE, EVIL) as looked:
        yield looked


@pytest.fixture
def looked(page: PageProcess, browser: LookedAtPage) -> LookedAtPage:
    page.changes()
    return browser


@pytest.fixture(scope="module")
def foreign() -> Iterator[int]:
    """Port of another page of this machine."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><html><body>another page</body></html>")

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


def socket_of(looked: LookedAtPage, url: str) -> str:
    import viser

    asked = [url.replace("http", "ws", 1), f"viser-v{viser.__version__}"]
    return str(looked.page.evaluate(SOCKET, asked))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "evil.example"])
def test_another_page_opens_no_socket_and_is_served_nothing(
    page: PageProcess, looked: LookedAtPage, foreign: int, host: str
) -> None:
    served: list[Any] = []
    place = urlsplit(page.url)
    looked.page.goto(f"http://{host}:{foreign}/", timeout=PATIENCE)
    looked.page.on("response", lambda answer: served.append(answer) if f":{place.port}/" in answer.url else None)
    for name in ("127.0.0.1", "localhost", "evil.example"):
        root = f"http://{name}:{place.port}/"
        for address in (root, f"{root}{place.path.strip('/')}/"):  # even one that had learned the token
            assert socket_of(looked, address) == "refused"
        assert looked.page.evaluate(FETCH, root) == "asked"
        looked.page.evaluate(FRAME, root)
    assert len(served) >= 6
    assert {answer.status for answer in served} == {403}
    assert page.changes() == []


def test_name_that_resolves_to_this_machine_is_refused(page: PageProcess, looked: LookedAtPage) -> None:
    place = urlsplit(page.url)
    for path in ("/", place.path):
        answer = looked.page.goto(f"http://evil.example:{place.port}{path}", timeout=PATIENCE)
        assert answer.status == 403
        assert "Refused" in looked.words()
        assert socket_of(looked, f"http://evil.example:{place.port}{place.path}") == "refused"


def test_page_is_framed_by_no_other(page: PageProcess, looked: LookedAtPage, foreign: int) -> None:
    looked.page.goto(f"http://localhost:{foreign}/", timeout=PATIENCE)
    looked.page.evaluate(FRAME, page.url)
    assert all("catenary" not in frame.content() for frame in looked.page.frames)
    assert any("X-Frame-Options" in complaint for complaint in looked.complaints)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_page_works_at_its_own_address_and_is_found_again_after_a_reload(
    page: PageProcess, looked: LookedAtPage, host: str
) -> None:
    looked.complaints.clear()
    looked.page.goto(page.url.replace("127.0.0.1", host), timeout=PATIENCE)
    for payload in (0.5, 0.75):
        looked.tab("Surroundings")
        looked.set_slider("payload [kg]", payload)
        told = Change("payload_kg", payload)
        looked.wait_until(lambda told=told: told in page.changes())
        looked.page.reload(timeout=PATIENCE)
    assert looked.complaints == []
