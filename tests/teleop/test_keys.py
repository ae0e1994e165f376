from hypothesis import given
from hypothesis import strategies as st

from catenary.teleop.keys import PATIENCE, KeyReader

SENT = {
    "up": b"\x1b[A",
    "down": b"\x1bOB",
    "page up": b"\x1b[5~",
    "q": b"q",
    "H": b"H",
    "ö": "ö".encode(),
    " ": b" ",
}


@given(st.lists(st.sampled_from(sorted(SENT)), max_size=20), st.data())
def test_keys_are_the_same_however_the_bytes_are_split(keys: list[str], data: st.DataObject) -> None:
    sent = b"".join(SENT[key] for key in keys)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=5)))
    reader, found = KeyReader(), []
    for first, last in zip([0, *cuts], [*cuts, len(sent)], strict=True):
        if sent[first:last]:
            found += reader.feed(sent[first:last], now=0.0)
    assert found == keys


@given(st.binary(max_size=40))
def test_no_bytes_are_too_strange(data: bytes) -> None:
    reader = KeyReader()
    assert all(key.isprintable() for key in reader.feed(data, 0.0) + reader.feed(b"", 2.0 * PATIENCE))
    assert reader.feed(b"q", 3.0 * PATIENCE) == ["q"]


def test_letters_of_other_keys_sequences_move_nothing() -> None:
    assert KeyReader().feed(b"\x1b[15~\x1b[1;5C\x1bq\x1b[200~", 0.0) == []


def test_a_lone_escape_is_a_key_once_nothing_follows() -> None:
    reader = KeyReader()
    assert reader.feed(b"\x1b", 0.0) == []
    assert reader.feed(b"", 0.5 * PATIENCE) == []
    assert reader.feed(b"", 2.0 * PATIENCE) == ["escape"]
