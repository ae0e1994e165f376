"""The view's page in its own process: sends states, receives changes of controls, without blocking."""

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
from catenary.view.page_content import Change, PageContent, Value
from catenary.view.viser_page import ViserPage, open_server

_DRAW_HZ = 20.0
_WRITE_EVERY_PICTURES, _PLOT_EVERY_PICTURES = 5, 10  # frames between two updates of text, of curves and paths
_START_WITHIN_S = 120.0  # [s]
_FIRST_PORT = 8080
_SHOWN_NOTES, _WORD_CHARACTERS = 6, 140  # number and length of displayed notes


class PageProcess:
    """Process of a page, as a context manager; its `url` is valid before `open` sets the content."""

    def __init__(self, *, port: int = _FIRST_PORT) -> None:
        if not 1024 <= port <= 65535:
            raise InputError(f"--port: expected 1024 to 65535, got {port}")
        if find_spec("viser") is None:
            raise MissingPackageError(f"catenary view needs viser, which is not installed: {to_install('view')}")
        # a new interpreter: a fork would copy the loop's threads and compiled code
        context = multiprocessing.get_context("spawn")
        self._pipe, self._theirs = context.Pipe()
        self._process = context.Process(target=_run_page, args=(self._theirs, port), daemon=True, name="catenary view")
        self._is_open = False
        self._url: str | None = None

    @property
    def url(self) -> str:
        """Address of the page, with its access token; the page is empty until `open`."""
        if self._url is None:
            self._url = self._answer()
        return self._url

    def open(self, shown: PageContent) -> str:
        """Show an arm, and return the address of the page."""
        url = self.url
        with contextlib.suppress(OSError):  # reported by the answer
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
        """The page's process is alive."""
        return self._process.is_alive()

    def put(self, state: Snapshot, values: Mapping[str, Value] = MappingProxyType({})) -> None:
        """Show a state, and values of controls, unless the page has not received the last one."""
        if self._is_open and takes_more(self._pipe):
            with contextlib.suppress(OSError):  # the page has ended
                self._pipe.send((truncated_state(state), dict(values)))

    def changes(self) -> list[Change]:
        """Return the changes of controls since the last call."""
        changes: list[Change] = []
        with contextlib.suppress(OSError, EOFError):  # the page has ended
            while self._pipe.poll():
                changes.append(Change(*self._pipe.recv()))
        return changes

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
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the parent, which ends this process
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
        with lock:  # no change is sent before the answer
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


def truncated_state(state: Snapshot) -> Snapshot:
    """Return a state with truncated texts, whatever the names of a robot or a file."""

    def cut(text: str) -> str:  # without undecodable characters, as in a file's name
        return text[:_WORD_CHARACTERS].encode(errors="replace").decode()

    return state._replace(
        fault=cut(state.fault), silent=state.silent and cut(state.silent), doing=cut(state.doing),
        notes=tuple(map(cut, state.notes[:_SHOWN_NOTES])),
    )  # fmt: skip


Seen = tuple[Snapshot, dict[str, Value]]  # state, and values of controls set by the program


def newest(pipe: Connection) -> Seen | None:
    """Return the newest message, None without one; raise EOFError when the program has ended the page."""
    seen: Seen | None = None
    while pipe.poll():
        seen = pipe.recv()
        if seen is None:
            raise EOFError
    return seen


def draw(page: ViserPage, take: Callable[[], Seen | None]) -> None:
    """Draw states at up to 20 Hz, and none without a connected browser."""
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
