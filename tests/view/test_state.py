import multiprocessing
import time

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.view.page_process import PageProcess, newest
from catenary.view.state import MOST_WARNINGS, shortened, unknown_state
from view.arms import Q, state


@pytest.mark.parametrize("word", ["warning " * 100, "\u00fc" * 5000, "\U0001f916" * 900, "\x00" * 900, "\ud800" * 900])
def test_words_that_take_much_room_are_cut_and_never_lost_with_the_numbers(word: str) -> None:
    told = shortened(state(2.5, warnings=(word,) * 20, mode=word))
    assert told.time == 2.5
    assert len(told.warnings) == MOST_WARNINGS
    assert told.mode.encode()


def test_the_newest_state_is_taken_once_and_the_end_is_noticed() -> None:
    ours, theirs = multiprocessing.Pipe()
    assert newest(theirs) is None
    ours.send(state(1.0))
    ours.send(state(2.0, mode="ENABLED"))
    taken = newest(theirs)
    assert taken is not None
    assert (taken.time, taken.mode) == (2.0, "ENABLED")
    assert_array_equal(taken.q, Q)
    assert newest(theirs) is None
    ours.send(None)
    with pytest.raises(EOFError):
        newest(theirs)


def test_who_puts_states_is_not_held_up_by_a_page_that_never_takes_them_or_is_gone() -> None:
    page = PageProcess()
    page._is_open = True
    durations = []
    for k in range(300):
        begin = time.thread_time()
        page.put(unknown_state(7)._replace(time=float(k), warnings=("x" * 1000,) * 20))
        durations.append(time.thread_time() - begin)
    assert np.median(durations) < 5e-4  # of a millisecond's tick
    page._theirs.close()
    page.put(unknown_state(7))
