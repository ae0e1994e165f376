"""What Cyclone DDS prints on standard error, with its lines about malformed packets thinned.

Anybody can send garbage to a port, and Cyclone prints a line for each packet; neither its settings nor its package for
Python can leave these out alone. But a domain prints to the stream that C's `stderr` is while the domain is made.
"""

import atexit
import ctypes
import fcntl
import os
import platform
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress

QUIET = 5.0  # [s] between two lines about malformed packets
_SIZE = 2**20  # bytes that wait; Cyclone itself must not, since it holds locks that Python's threads wait for
_stream: int | None = None  # of C's library, made once


@contextmanager
def thinned() -> Iterator[None]:
    """Have a domain that is made inside print so, where the C library is glibc; one thread at a time."""
    global _stream
    if platform.libc_ver()[0] != "glibc":
        yield
        return
    libc = ctypes.CDLL(None)
    _stream = _stream or _piped(libc)
    stderr = ctypes.c_void_p.in_dll(libc, "stderr")
    usual, stderr.value = stderr.value, _stream
    try:
        yield
    finally:
        stderr.value = usual


def _piped(libc: ctypes.CDLL) -> int:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with suppress(OSError):
        fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, _SIZE)
    libc.fdopen.restype = ctypes.c_void_p
    stream: int = libc.fdopen(writing, b"w")
    libc.setvbuf(
        ctypes.c_void_p(stream), None, 2, 0
    )  # unbuffered: a line goes into the pipe whole or not at all
    thread = threading.Thread(target=_pass_on, args=(reading,), daemon=True)
    thread.start()
    atexit.register(thread.join)
    atexit.register(
        os.dup2, 2, writing
    )  # before that: the pipe ends, and what is printed later goes straight out
    return stream


def _pass_on(reading: int) -> None:
    count, quiet_until = 0, 0.0
    with open(reading, "rb") as lines, suppress(OSError):  # nobody may be reading standard error
        for line in lines:
            if b": malformed packet" in line:
                count, now = count + 1, time.monotonic()
                if now < quiet_until:
                    continue
                quiet_until = now + QUIET
                line = line.rstrip() + (b" (%d times so far)\n" % count if count > 1 else b"\n")
            os.write(2, line)
