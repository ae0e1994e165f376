"""The campaign itself: what ends a case, what is kept of it, what counts."""

import ctypes
import json
import math
import time
import warnings
from pathlib import Path

import pytest

from catenary.errors import InputError
from tests.campaign.part import Part, chosen
from tests.campaign.results import Results
from tests.campaign.run import run_part

MODULE = "tests.campaign.test_campaign"  # where the child process finds PARTS


def misbehave(seed: int, folder: Path) -> None:
    """Hold with 0, 1 and from 7 on; fail otherwise, in a way for each seed."""
    (folder / "input").write_text(str(seed))
    if seed == 1:
        raise InputError("refused")
    if seed == 2:
        raise ValueError("another error")
    if seed == 3:
        bytearray(2 * 10**9)
    if seed == 4:
        ctypes.string_at(0)
    if seed == 5:
        while True:
            pass
    if seed == 6:
        warnings.warn("overflow", RuntimeWarning, stacklevel=1)


WORDS = {
    2: "ValueError: another error",
    3: "MemoryError",
    4: "the process ended by SIGSEGV",
    5: "took too much processor time",
    6: "RuntimeWarning: overflow",
}
PARTS = (
    Part("made.up", 12, misbehave, may_refuse=True, processor_time=0.5),
    Part("made.hang", 1, lambda seed, folder: time.sleep(600.0), patience=0.5),
)


def test_every_way_to_fail_is_found_and_kept_and_counts_once(tmp_path: Path) -> None:
    part = PARTS[0]
    results = Results(tmp_path)

    def run(count: int | None) -> None:
        tried: dict[int, str | None] = {}
        for seeds in results.following(part, count):
            run_part(MODULE, part, seeds, tried.__setitem__, deadline=math.inf, out=tmp_path)
        results.add(part, tried, 1.0)

    run(10)
    entry = results.read()["parts"]["made.up"]
    assert {failure["seed"]: failure["why"] for failure in entry["failures"]} == WORDS
    assert entry["tried"] == 10
    for seed, why in WORDS.items():
        kept = tmp_path / "failures" / "made.up" / str(seed)
        assert (kept / "input").read_text() == str(seed)
        assert why in (kept / "why.txt").read_text()
    assert "test_campaign.py" in (tmp_path / "failures" / "made.up" / "5" / "why.txt").read_text()
    # failures are tried again, then what the target still wants
    assert list(results.following(part, None)) == [*(range(seed, seed + 1) for seed in WORDS), range(10, 12)]
    results.add(part, {2: None, 9: None, 10: None}, 1.0)
    entry = results.read()["parts"]["made.up"]
    assert (entry["tried"], [failure["seed"] for failure in entry["failures"]]) == (11, [3, 4, 5, 6])
    assert not (tmp_path / "failures" / "made.up" / "2").exists()
    assert json.loads(results.path.read_text())["version"]


def test_a_case_that_hangs_is_ended(tmp_path: Path) -> None:
    tried: dict[int, str | None] = {}
    run_part(MODULE, PARTS[1], range(1), tried.__setitem__, deadline=math.inf, out=tmp_path)
    assert (tried[0] or "").startswith("did not end within 0.5 s")
    assert "test_campaign.py" in (tried[0] or "")  # where it was


def test_a_deadline_ends_a_part_after_one_case(tmp_path: Path) -> None:
    tried: dict[int, str | None] = {}
    run_part(MODULE, PARTS[0], range(8, 20), tried.__setitem__, deadline=0.0, out=tmp_path)
    assert tried == {8: None}


def test_unknown_parts_are_named_with_the_choices() -> None:
    with pytest.raises(SystemExit, match="unknown part nothing; there are: "):
        chosen(["nothing"])
