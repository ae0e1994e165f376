"""A part of the bench whose cases take seconds: what must be refused or named, and what must pass."""

from pathlib import Path

import numpy as np
import pytest

from tests.truth.bench import FAILS, HOLDS, NAMED, REFUSED, Claims, checked, evaluated, fitted, judged
from tests.truth.imports import imports
from tests.truth.recordings import raven
from tests.truth.spoilings import SPOILINGS

OF = {spoiling.name: spoiling for spoiling in SPOILINGS}


@pytest.mark.parametrize(
    ("low", "high", "true", "coverage", "holds"),
    [
        ([1.0, 0.5], [1.0, 0.5], [1.1, 0.5], None, True),
        ([1.0, 0.5], [1.0, 0.5], [1.3, 0.5], None, False),
        ([1.0, 0.5], [1.3, 0.5], [1.3, 0.5], None, True),
        ([1.0, 0.5], [2.6, 0.5], [1.3, 0.5], None, False),  # says nothing
        ([0.001, 0.5], [0.001, 0.5], [0.003, 0.5], None, True),  # nobody cares
        ([1.0], [1.0], [1.0], (0.9, 0.9, 0.86), True),
        ([1.0], [1.0], [1.0], (0.9, 0.9, 0.80), False),
        ([1.0], [1.0], [1.0], (0.8, 1.0, 0.80), True),
        ([1.0], [1.0], [1.0], (0.6, 1.0, 0.80), False),  # says nothing
    ],
)
def test_a_claim_holds_near_the_truth_and_where_it_says_something(low, high, true, coverage, holds):
    shares = [None] * 3 if coverage is None else [np.array([each]) for each in coverage]
    assert judged(Claims(np.array(low), np.array(high), *shares[:2]), np.array(true), shares[2])[2] is holds


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "verdicts"),
    [
        ("0.15 s late", (REFUSED,)),
        ("0.15 s early", (REFUSED,)),
        ("0.05 s late", (NAMED,)),
        ("one row in 100 wild", (NAMED,)),
        ("fast rows lost", (NAMED, HOLDS)),
        ("slack cut out", (NAMED, HOLDS)),
    ],
)
def test_a_spoilt_recording_is_refused_or_its_doubt_named_or_its_claim_holds(tmp_path: Path, name, verdicts):
    assert fitted(raven("random"), OF[name], tmp_path).verdict in verdicts


@pytest.mark.slow
def test_untouched_recordings_pass(tmp_path: Path):
    assert evaluated(raven("random"), OF["untouched"], tmp_path).verdict == HOLDS
    assert not checked(raven("random"), 120.0, tmp_path).verdict.startswith(FAILS)


@pytest.mark.slow
def test_tables_are_imported_as_they_are_and_no_unit_is_advised_that_is_none(tmp_path: Path):
    assert [outcome for outcome in imports(tmp_path) if outcome.failed] == []
