"""The page in a real browser: what is seen, what controls do, and what other pages get."""

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from view.browser import PATIENCE, SIZE, LookedAtPage, looked_at, looked_at_empty
from view.command import model_of_positions, view
from view.connected import page_of_an_arm

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

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


class OtherPage(BaseHTTPRequestHandler):
    """Another page of this machine."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><html><body>another page</body></html>")

    def log_message(self, *_: object) -> None:
        pass


def test_other_pages_and_names_of_this_machine_reach_nothing() -> None:
    import viser

    served: list[Any] = []
    with (
        page_of_an_arm(18540) as page,
        looked_at_empty(SIZE, EVIL) as looked,
        ThreadingHTTPServer(("127.0.0.1", 0), OtherPage) as foreign,
    ):
        threading.Thread(target=foreign.serve_forever, daemon=True).start()
        place = urlsplit(page.url)
        looked.page.on("response", lambda answer: served.append(answer) if f":{place.port}/" in answer.url else None)
        for host in ("127.0.0.1", "localhost", "evil.example"):
            looked.page.goto(f"http://{host}:{foreign.server_port}/", timeout=PATIENCE)
            for name in ("127.0.0.1", "localhost", "evil.example"):
                root = f"http://{name}:{place.port}/"
                for address in (root, f"{root}{place.path.strip('/')}/"):  # even one that had learned the token
                    asked = [address.replace("http", "ws", 1), f"viser-v{viser.__version__}"]
                    assert looked.page.evaluate(SOCKET, asked) == "refused"
                assert looked.page.evaluate(FETCH, root) == "asked"
                looked.page.evaluate(FRAME, root)
        looked.page.goto(f"http://evil.example:{place.port}{place.path}", timeout=PATIENCE)
        assert "Refused" in looked.words()
        foreign.shutdown()
        assert len(served) >= 18
        assert {answer.status for answer in served} == {403}
        assert page.changes() == []


SENSED = "PD + sensed gravity (DG)"


@pytest.fixture(scope="module")
def looked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LookedAtPage]:
    """The page of a simulated RAVEN-II with a model, at rest; one for all tests, each of which leaves it as it was."""
    model = model_of_positions(tmp_path_factory.mktemp("model") / "arm.npz")
    with view("raven2", "--model", model) as url, looked_at(url) as looked:
        looked.choose("controller", SENSED)
        rest(looked)
        yield looked
        assert looked.complaints == []
        assert looked.foreign == []


def rest(looked: LookedAtPage) -> None:
    looked.tab("Drive")
    looked.choose("motion", "rest")
    looked.wait_for_text("ENABLED, homed: rest")


def test_the_reported_and_the_calibrated_arm_are_seen_apart_and_the_reported_one_goes_where_its_slider_is(
    looked: LookedAtPage,
) -> None:
    looked.wait_for_color(0.004, more=2, than=(0, 1))  # blue where only the reported arm is
    looked.wait_for_color(0.004, more=1, than=(0, 2))  # green where only the calibrated one is
    looked.wait_until(lambda: abs(looked.joint("elbow", 0) - looked.joint("elbow", 1)) > 4.0)  # encoders' zero: 7.5 deg
    before = looked.picture()
    goal = looked.joint("shoulder") + (20.0 if looked.joint("shoulder") < 45.0 else -20.0)
    looked.set_slider("shoulder [deg]", round(goal))
    looked.wait_for_joint("shoulder", round(goal), within=2.0)
    looked.wait_until(lambda: np.mean(np.abs(looked.picture() - before).max(axis=2) > 30) > 0.01)
    rest(looked)


def test_switched_on_the_model_puts_the_calibrated_joint_where_the_slider_says(looked: LookedAtPage) -> None:
    looked.tab("Drive")
    looked.set_slider("elbow [deg]", 60.0)
    looked.wait_until(lambda: abs(looked.joint("elbow", 0) - 60.0) < 0.7 < abs(looked.joint("elbow", 1) - 60.0))
    looked.tab("Model")
    looked.tick("use the model in the loop")
    looked.wait_until(lambda: abs(looked.joint("elbow", 1) - 60.0) < 0.7 < abs(looked.joint("elbow", 0) - 60.0))
    looked.tick("use the model in the loop")
    rest(looked)
