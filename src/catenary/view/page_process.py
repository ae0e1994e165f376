"""The page in its own process: states go in, changes of controls come out, neither side waits."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import Self

from catenary.errors import CatenaryError, InputError, MissingPackageError, to_install
from catenary.monitor import Snapshot
from catenary.operating_system import takes_more
from catenary.view.shown import Change, Shown, Value
from catenary.view.viser_page import ViserPage, open_server

_DRAW_HZ = 20.0
_WRITE_EVERY_PICTURES, _PLOT_EVERY_PICTURES = 5, 10  # pictures between two updates of words, of curves and paths
_START_WITHIN_S = 120.0  # [s]
_FIRST_PORT = 8080
_SHOWN_NOTES, _WORD_CHARACTERS = 6, 140  # of what the program says; characters of each


class PageProcess:
    """A page in a process of its own while it is entered; its `url` can be opened before `open` says what it shows."""

    def __init__(self, *, port: int = _FIRST_PORT) -> None:
        """Take a port of 127.0.0.1; the next free one where it is taken."""
        if not 1024 <= port <= 65535:
            raise InputError(f"--port: expected 1024 to 65535, got {port}")
        if find_spec("viser") is None:
            raise MissingPackageError(f"catenary view needs viser, which is not installed: {to_install('view')}")
        # a fresh interpreter: a fork would take the loop's threads and compiled code along
        context = multiprocessing.get_context("spawn")
        self._pipe, self._theirs = context.Pipe()
        self._process = context.Process(target=_run_page, args=(self._theirs, port), daemon=True, name="catenary view")
        self._is_open = False
        self._url: str | None = None

    @property
    def url(self) -> str:
        """Address of the page, which is empty until `open`; whoever knows it can do what the page can."""
        if self._url is None:
            self._url = self._answer()
        return self._url

    def open(self, shown: Shown) -> str:
        """Show an arm, and return the address of the page."""
        url = self.url
        with contextlib.suppress(OSError):  # the answer says so
            self._pipe.send(shown)
        self._answer()
        self._is_open = True
        return url

    def _answer(self) -> str:
        try:
            if not self._pipe.poll(_START_WITHIN_S):
                raise CatenaryError(f"the view's page did not start within {_START_WITHIN_S:g} s")
            failed, text = self._pipe.recv()
        except (EOFError, OSError):
            failed, text = True, "the process of the view's page ended"
        if failed:
            raise CatenaryError(str(text))
        return str(text)

    @property
    def is_running(self) -> bool:
        """Whether the page is still there."""
        return self._process.is_alive()

    def put(self, state: Snapshot, values: Mapping[str, Value] = MappingProxyType({})) -> None:
        """Show a state, and values of controls, unless the page has not taken what was sent before."""
        if self._is_open and takes_more(self._pipe):
            with contextlib.suppress(OSError):  # a page that is gone shows nothing
                self._pipe.send((shortened(state), dict(values)))

    def changes(self) -> list[Change]:
        """Return what was changed on the page since the last call."""
        found: list[Change] = []
        with contextlib.suppress(OSError, EOFError):  # a page that is gone changes nothing
            while self._pipe.poll():
                found.append(Change(*self._pipe.recv()))
        return found

    def close(self) -> None:
        """End the process."""
        with contextlib.suppress(OSError):
            self._pipe.send(None)
        if self._process.pid is not None:
            self._process.join(3.0)
            if self._process.is_alive():
                self._process.kill()
                self._process.join(1.0)
        self._is_open = False
        self._pipe.close()

    def __enter__(self) -> Self:
        self._process.start()
        self._theirs.close()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _run_page(pipe: Connection, port: int) -> None:
    """Draw the states that come until the other side ends or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the program's, which then ends this process
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # viser prints a box
    lock = threading.Lock()

    def tell(change: Change) -> None:
        with lock, contextlib.suppress(OSError):
            pipe.send(tuple(change))

    try:
        server, url = open_server(port)
        pipe.send((False, url))
        shown = pipe.recv()
        if shown is None:
            server.stop()
            return
        with lock:  # a browser that is there already tells nothing before the answer
            page = ViserPage(shown, server, tell)
            pipe.send((False, ""))
    except EOFError:
        return
    except (CatenaryError, OSError, RuntimeError, ImportError) as error:
        pipe.send((True, f"the view's page cannot be opened: {error}"))
        return
    with contextlib.suppress(EOFError, OSError):
        draw(page, lambda: newest(pipe))
    page.close()


def shortened(state: Snapshot) -> Snapshot:
    """Return a state whose words take little room, whatever a robot's or a file's names are."""

    def cut(text: str) -> str:  # without what is none, as in a file's name
        return text[:_WORD_CHARACTERS].encode(errors="replace").decode()

    return state._replace(
        fault=cut(state.fault), silent=state.silent and cut(state.silent), doing=cut(state.doing),
        notes=tuple(map(cut, state.notes[:_SHOWN_NOTES])),
    )  # fmt: skip


Seen = tuple[Snapshot, dict[str, Value]]  # and values of controls that the program has set


def newest(pipe: Connection) -> Seen | None:
    """Return what has come last, None where nothing has; the end, which is told as None, is an EOFError."""
    seen: Seen | None = None
    while pipe.poll():
        seen = pipe.recv()
        if seen is None:
            raise EOFError
    return seen


def draw(page: ViserPage, take: Callable[[], Seen | None]) -> None:
    """Draw states as they come, twenty times a second at most, and none while no browser is connected."""
    number = 0
    while True:
        begin = time.monotonic()
        seen = take()
        if seen is not None and page.clients:
            page.draw(seen[0])
            if number % _WRITE_EVERY_PICTURES == 0:
                page.write(*seen)
            if number % _PLOT_EVERY_PICTURES == 0:
                page.plot()
            number += 1
        time.sleep(max(0.002, 1.0 / _DRAW_HZ - (time.monotonic() - begin)))
