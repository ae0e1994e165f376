import threading
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.crtk.message_queues import Inbox, Subscription
from catenary.errors import FileFormatError
from patience import PATIENCE


def subscription(inbox: Inbox, **options: Any) -> Subscription:
    return Subscription("/t", "std_msgs/String", inbox, lambda data: data, **options)


@settings(deadline=None)
@given(st.lists(st.integers(0, 2), max_size=60), st.integers(1, 5))
def test_what_was_taken_and_what_overflowed_is_what_came(steps: list[int], depth: int) -> None:
    one = subscription(Inbox(), depth=depth)
    got, sent = [], 0
    for step in steps:
        if step:
            one.push((sent,), 0)
            sent += 1
        else:
            got += [received.message for received in one.take()]
    got += [received.message for received in one.take()]
    assert got == sorted(set(got))
    assert len(got) + one.overflowed == sent


def test_damaged_messages_are_left_out_and_counted() -> None:
    def refuse(data: Any) -> Any:
        if data == "bad":
            raise FileFormatError("bad")
        return data

    one = Subscription("/t", "std_msgs/String", Inbox(), refuse)
    for data in ("a", "bad", "b"):
        one.push(data, 0)
    assert [received.message for received in one.take()] == ["a", "b"]
    assert one.damaged == 1


@pytest.mark.parametrize("wait", ["take", "run"])
def test_closing_the_inbox_wakes_all_who_wait(wait: str) -> None:
    inbox = Inbox()
    wait_for = {"take": subscription(inbox).take, "run": inbox.run}[wait]
    waiting = [threading.Thread(target=wait_for, args=(10.0 * PATIENCE,), daemon=True) for _ in range(3)]
    for thread in waiting:
        thread.start()
    inbox.close()
    for thread in waiting:
        thread.join(PATIENCE)
        assert not thread.is_alive()


def test_whoever_waits_for_one_topic_is_not_given_what_comes_on_another() -> None:
    inbox, got = Inbox(), []
    one, other = subscription(inbox), subscription(inbox)
    waiting = threading.Thread(target=lambda: got.extend(one.take(600.0)))
    waiting.start()
    other.push("not this", 0)
    one.push("this", 1)
    waiting.join(60.0)
    assert [received.message for received in got] == ["this"]


def test_four_threads_lose_and_repeat_nothing() -> None:
    inbox = Inbox()
    one = subscription(inbox, depth=10_000)
    threads = [threading.Thread(target=lambda k=k: [one.push((k, i), 0) for i in range(1000)]) for k in range(4)]
    got = []
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        got += [received.message for received in one.take(0.01)]
    got += [received.message for received in one.take()]
    for k in range(4):
        assert [i for source, i in got if source == k] == list(range(1000))
