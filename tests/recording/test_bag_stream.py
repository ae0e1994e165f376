"""Recordings that end in something else than what was written: which rows are trusted, and how much is kept."""

import random
from pathlib import Path

import pytest

from tests.campaign.parts.tails import KINDS, messages, torn, whole

BEHIND = {
    "nothing": lambda data, tear: b"",
    "zeros": lambda data, tear: bytes(8192),
    "old bytes": lambda data, tear: data[tear - 9000 : tear - 9000 + len(data) - tear],
    "random bytes": lambda data, tear: random.Random(1).randbytes(5000),
}


@pytest.mark.alike
@pytest.mark.parametrize("behind", BEHIND)
@pytest.mark.parametrize("kind", KINDS)
def test_no_torn_tail_becomes_trusted_rows_and_what_was_whole_before_it_is_read(
    kind: str, behind: str, tmp_path: Path
) -> None:
    data, _, _ = whole(kind)
    for share in (0.4, 0.75, 0.95):
        tear = int(share * len(data))
        torn(kind, tear, BEHIND[behind](data, tear), tmp_path / str(share))


@pytest.mark.parametrize("kind", ["journal", "mcap", "mcap.unchunked", "mcap.one", "bag", "bag.one"])
def test_a_message_is_kept_from_the_byte_on_that_proves_it(kind: str, tmp_path: Path) -> None:
    """Places in two messages and of what is between them, of a file whose other bytes are zeros."""
    _, _, ends = whole(kind)
    middle = len(ends) // 2
    (first, _), (last, _) = ends[middle], ends[middle + 2]
    for tear in range(first, last, 19):
        torn(kind, tear, bytes(3000), tmp_path / str(tear), recovers=False)


def test_the_campaign_tears_what_it_says() -> None:
    assert {"journal", "resumed", "mcap.lz4", "mcap.zstd", "mcap.unchunked", "bag", "bag.bz2", "bag.lz4"} <= set(KINDS)
    assert len(messages(1)) > 900
