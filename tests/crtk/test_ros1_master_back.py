"""A master that stands still and goes on is told both ways, and keeps no Ctrl-C from a program; a peer that is slow is told by its name."""

import os
import signal
from pathlib import Path

import pytest

from patience import PATIENCE
from ros import OPEN, Program, running_master

pytestmark = pytest.mark.slow

TALKER = (
    OPEN
    + """
publisher = transport.publisher("/count", T, queue=5)
while not transport.connections("/count").subscribers:
    time.sleep(0.01)
print("connected", flush=True)
sys.stdin.readline()
pad = "x" * 10**6
while not publisher.overflowed:
    publisher.publish(message_class(T)(header(transport.now()), pad))
print(dict(publisher.missed), flush=True)
"""
)
CLOSING = (
    OPEN
    + """
import _thread, threading
heard = transport.subscribe("/count", T)
print("up", flush=True)
sys.stdin.readline()
threading.Timer(0.5, _thread.interrupt_main).start()
try:
    heard.close()
    print("the Ctrl-C was lost", flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
)
DEAF = (
    OPEN
    + """
import os, signal
transport.subscribe("/count", T)
print("listening", flush=True)
sys.stdin.readline()
"""
)


def test_ctrl_c_is_heeded_while_a_topic_ends_and_a_master_that_stands_still_keeps_no_program(tmp_path: Path) -> None:
    with running_master(tmp_path) as master, Program(master, CLOSING, "node") as node:
        assert node.line() == "up"
        assert master._process is not None
        os.kill(master._process.pid, signal.SIGSTOP)
        node.say("go")
        assert node.line() == "interrupted"
        node.finish(PATIENCE)
        assert node.process.returncode == 0


def test_who_misses_messages_is_named(tmp_path: Path) -> None:
    with (
        running_master(tmp_path) as master,
        Program(master, DEAF, "sleepy") as deaf,
        Program(master, TALKER, "talker") as talker,
    ):
        assert deaf.line() == "listening"
        assert talker.line() == "connected"
        with deaf.standing_still():
            talker.say("go")
            assert talker.line().startswith("{'/sleepy': ")
