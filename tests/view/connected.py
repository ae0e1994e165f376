"""A browser as far as the page's server can tell: a connection that reads what it is sent, and presses and pulls."""

import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Self

from catenary.robots.catalog import load_robot
from catenary.view.meshes import arm_shapes
from catenary.view.page_content import PageContent
from catenary.view.page_process import PageProcess
from catenary.view.simulated_arm import driving_tabs
from oracles.ideal_plant import IdealPlant
from patience import PATIENCE

CAMERA = {  # a browser is one that looks once it has said where its camera stands
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0), "fov": 0.9, "near": 0.01,
    "far": 100.0, "image_height": 600, "image_width": 800, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


def shown_arm() -> PageContent:
    """An arm with all kinds of controls."""
    model, plant = load_robot("raven2"), IdealPlant([0.8, 1.5, 0.4])
    tabs = driving_tabs(
        plant, plant.measured_js().q, motion="rest", controllers=("PD alone", "own"), has_cables=True, has_model=True
    )
    return PageContent("test", model, arm_shapes(model), tabs)


@contextmanager
def page_of_an_arm(port: int) -> Iterator[PageProcess]:
    """Its page in a process of its own, and no loop behind it."""
    with PageProcess(port=port) as page:
        page.open(shown_arm())
        yield page


def connect(url: str, **options: Any) -> Any:
    """Open a WebSocket as viser's page does, with other headers where they are given."""
    import viser
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    protocol = Subprotocol(f"viser-v{viser.__version__}")
    address = url.replace("http", "ws", 1)
    return connect(address, subprotocols=[protocol], max_size=None, proxy=None, **options)


class Connected:
    """A connection that looks at a page and knows its controls by their labels."""

    def __init__(self, url: str, **options: Any) -> None:
        self._socket = connect(url, **options)
        self.controls: dict[str, str] = {}  # their uuid
        self.values: dict[str, Any] = {}  # by label, as the server says
        self.words: dict[str, str] = {}  # texts by their uuid
        self._is_whole = False
        self._send(CAMERA)
        self.wait(lambda: self._is_whole)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def _send(self, message: dict[str, Any]) -> None:
        import msgspec

        self._socket.send(msgspec.msgpack.encode(message))

    def wait(self, claim: Callable[[], object], seconds: float = PATIENCE) -> None:
        """Read what is sent until a claim is true."""
        end = time.monotonic() + seconds
        while not claim():
            try:
                self._read(self._socket.recv(timeout=max(0.0, end - time.monotonic())))
            except TimeoutError:
                raise AssertionError(f"it did not come true; the page says: {self.words}") from None

    def _read(self, data: bytes) -> None:
        import msgspec
        import zstandard

        _, size = struct.unpack_from("<QQ", data)
        inner = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
        for message in msgspec.msgpack.decode(inner, strict=False)["messages"]:
            kind, uuid, props = message["type"], message.get("uuid"), message.get("props") or {}
            self._is_whole |= kind == "ReplayDoneMessage"
            if kind.startswith("Gui") and isinstance(props, dict) and "label" in props:
                self.controls[props["label"]] = uuid
                self.values[props["label"]] = message.get("value")
            updates = message["updates"] if kind == "GuiUpdateMessage" else {}
            if "value" in updates:
                self.values |= {label: updates["value"] for label, known in self.controls.items() if known == uuid}
            if isinstance(text := updates.get("content"), str):
                self.words[uuid] = text

    def set(self, label: str, value: object) -> None:
        """Set a control to whatever value."""
        self._send({"type": "GuiUpdateMessage", "uuid": self.controls[label], "updates": {"value": value}})
