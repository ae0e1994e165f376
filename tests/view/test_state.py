import multiprocessing
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.view.state import MOST_WARNINGS, SharedState, ViewState, unknown_state
from view.arms import state


def same(a: ViewState, b: ViewState) -> bool:
    return all(
        np.array_equal(x, y, equal_nan=True) if isinstance(x, np.ndarray) else x == y
        for x, y in zip(a[:13], b[:13], strict=True)
    )


@given(st.integers(1, 20), st.floats(allow_nan=False), st.text(max_size=40), st.lists(st.text(max_size=40), max_size=4))
def test_state_comes_back_as_it_was_put(n: int, time: float, mode: str, warnings: list[str]) -> None:
    written = unknown_state(n)._replace(
        time=time,
        q=np.arange(float(n)),
        mode=mode,
        warnings=tuple(warnings),
        values={"motion": "rest", "roll_deg": 3.0},
    )
    with SharedState(n) as out, SharedState(n, out.name) as reader:
        out.put(written)
        back = reader.take()
    assert same(back, written)
    assert (back.mode, back.warnings, back.values) == (mode, tuple(warnings), written.values)


@pytest.mark.parametrize("word", ["warning " * 100, "ü" * 5000, "\U0001f916" * 900, "\x00" * 900])
def test_words_that_do_not_fit_are_cut_and_never_lost_with_the_numbers(word: str) -> None:
    with SharedState(3) as out, SharedState(3, out.name) as reader:
        out.put(state(2.5, warnings=(word,) * 20, mode=word, values={"x": word * 40}))
        back = reader.take()
    assert back.time == 2.5
    assert len(back.warnings) == MOST_WARNINGS
    assert back.mode


def write_for_a_while(name: str, n: int, seconds: float) -> None:
    with SharedState(n, name) as out:
        end, k = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            k += 1
            out.put(unknown_state(n)._replace(time=float(k), q=np.full(n, float(k)), tau=np.full(n, float(k))))


def test_newest_state_is_taken_once() -> None:
    with SharedState(3) as out, SharedState(3, out.name) as reader:
        assert reader.take() is None
        out.put(state(1.0))
        out.put(state(2.0, mode="ENABLED"))
        taken = reader.take()
        assert taken is not None
        assert (taken.time, taken.mode) == (2.0, "ENABLED")
        assert reader.take() is None


def test_states_are_taken_whole_or_not_at_all_while_another_process_writes() -> None:
    n = 200  # large, so that writing takes its time
    with SharedState(n) as mine:
        writer = multiprocessing.get_context("spawn").Process(target=write_for_a_while, args=(mine.name, n, 1.5))
        writer.start()
        times = []
        while writer.is_alive():
            taken = mine.take()
            if taken is not None:
                assert np.array_equal(taken.q, np.full(n, taken.time))
                assert np.array_equal(taken.tau, taken.q)
                times.append(taken.time)
        writer.join()
    assert len(times) > 10
    assert times == sorted(times)


def test_writer_is_not_held_up_by_readers_that_are_gone_or_never_read() -> None:
    with SharedState(7) as out:
        with SharedState(7, out.name):
            pass
        durations = []
        for k in range(300):
            begin = time.thread_time()
            out.put(state_of_seven(k))
            durations.append(time.thread_time() - begin)
        assert np.median(durations) < 5e-4  # of a millisecond's tick; it takes some 0.03 ms


def state_of_seven(k: int):
    return unknown_state(7)._replace(time=float(k), q=np.zeros(7))


def test_nothing_is_put_or_taken_after_closing() -> None:
    out = SharedState(3)
    thread = threading.Thread(target=out.close)
    thread.start()
    thread.join()
    out.put(state(1.0))
    assert out.take() is None
