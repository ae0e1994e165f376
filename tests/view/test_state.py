import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.view.state import (
    MOST_WARNINGS,
    TEXT,
    ViewState,
    read_state,
    state_record,
    unknown_state,
    write_state,
)
from view.arms import state


def same(a: ViewState, b: ViewState) -> bool:
    return all(
        np.array_equal(x, y, equal_nan=True) if isinstance(x, np.ndarray) else x == y
        for x, y in zip(a[:13], b[:13], strict=True)
    )


@given(
    st.integers(1, 20),
    st.floats(allow_nan=False),
    st.text(max_size=40),
    st.lists(st.text(max_size=40), max_size=4),
)
def test_state_comes_back_as_it_was_written(n: int, time: float, mode: str, warnings: list[str]) -> None:
    written = unknown_state(n)._replace(
        time=time,
        q=np.arange(float(n)),
        mode=mode,
        warnings=tuple(warnings),
        values={"motion": "rest", "roll_deg": 3.0},
    )
    record = np.zeros((), state_record(n))
    write_state(written, record)
    back = read_state(record)
    assert same(back, written)
    assert (back.mode, back.warnings, back.values) == (mode, tuple(warnings), written.values)


@pytest.mark.parametrize("word", ["warning " * 100, "ü" * 5000, "\x00" * 900])
def test_words_that_do_not_fit_are_cut_and_never_lost_with_the_numbers(word: str) -> None:
    record = np.zeros((), state_record(3))
    write_state(state(2.5, warnings=(word,) * 20, mode=word, values={"x": word * 40}), record)
    back = read_state(record)
    assert back.time == 2.5
    assert len(back.warnings) <= MOST_WARNINGS
    assert int(record["text_length"]) <= TEXT
    assert back.mode
