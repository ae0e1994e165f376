"""How long tests wait for what must happen: a machine that is busy is late, and not wrong.

A test waits for a condition, never for a time in which it hopes that something has happened. What never happens is told
after PATIENCE. Programs under test have limits of their own, for real robots on machines of their own; where such a limit
is not what a test is about, it is lengthened.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE = 60.0  # [s]


def until(claim: Callable[[], object], *, every: float = 0.002, seconds: float = PATIENCE) -> None:
    """Wait until a claim is true, looking every so often [s]."""
    end = time.monotonic() + seconds
    while not claim():
        assert time.monotonic() < end, f"it did not come true in {seconds:g} s"
        time.sleep(every)


@contextmanager
def polled(transport: Any) -> Iterator[None]:
    """Have a transport's services run in a thread, as a server that ticks does."""
    ended = threading.Event()

    def poll() -> None:
        while not ended.is_set() and not transport.inbox.closed:
            transport.inbox.run(0.05)

    thread = threading.Thread(target=poll, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def longer_limits() -> Iterator[tuple[Any, str, Any]]:
    """What limits how long others may take: objects, names of their attributes, and longer ones."""
    from catenary.crtk import client
    from catenary.crtk.ros1 import master as ros1_master
    from catenary.crtk.serving import command_source

    connect = client.CrtkClient.__init__
    yield ros1_master, "_ANSWER_WITHIN_S", PATIENCE  # for the master's answers
    yield client, "_COMMAND_TIMEOUT_S", PATIENCE  # for a robot's new state
    yield command_source, "_OLDEST_STAMP_NS", round(1e9 * PATIENCE)  # of a stamped command on its way
    longer = {"connect_timeout": PATIENCE, "stale_after": PATIENCE}
    yield connect, "__kwdefaults__", {**(connect.__kwdefaults__ or {}), **longer}


def lengthen_limits() -> None:
    """Give this program longer limits, until it ends."""
    for place, name, value in longer_limits():
        setattr(place, name, value)
