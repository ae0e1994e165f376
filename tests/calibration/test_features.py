from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration import features as features_of_rows
from catenary.calibration.features import FeatureSet, choose_signals, signals_of
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.kernels.bind import run
from hysteretic_arm import play as pushed
from recordings import STEP, recording

NAMES, UNITS = ("q:J1", "q:J2", "q:J3"), ("rad", "rad", "m")
LOG = recording(np.random.default_rng(0), rows=12)

motions = arrays(np.float64, st.integers(1, 30), elements=st.floats(-100.0, 100.0, width=32))
half_widths = st.floats(0.0, 50.0)
repeatable = settings(derandomize=True, deadline=None)  # the first call compiles


def play(x: np.ndarray, r: float) -> np.ndarray:
    """Play state of half-width r after each position of a motion."""
    features = FeatureSet(("q:J1",), ("rad",), play=(("q:J1", r),))
    memory, places = features.memory(), []
    for position in x:
        run(features.row_steps(np.array([[position]]), memory, np.empty((1, 2)), np.ones(1), np.zeros(1, bool)))
        places.append(memory.play[0])
    return np.array(places)


@repeatable
@given(motions, half_widths)
def test_play_is_a_block_pushed_by_a_pin(x: np.ndarray, r: float) -> None:
    assert_allclose(play(x, r), pushed(x, r), rtol=0.0, atol=1e-12)  # rounding of numbers up to 150


@repeatable
@given(motions, half_widths, st.lists(st.floats(0.0, 1.0), min_size=1, max_size=4))
def test_play_does_not_depend_on_the_rate_of_sampling(x: np.ndarray, r: float, shares: list[float]) -> None:
    finer, kept = [x[0]], [0]
    for a, b in pairwise(x):
        finer += list(np.clip([a + share * (b - a) for share in sorted(shares)], min(a, b), max(a, b)))
        kept.append(len(finer))
        finer.append(b)
    assert_array_equal(play(np.array(finer), r)[kept], play(x, r))


def test_play_begins_anew_where_the_clock_goes_back() -> None:
    time = np.array([*range(7), *range(5)], dtype=float)
    X = FeatureSet(NAMES, UNITS, play=(("q:J1", 0.2),)).matrix(replace(LOG, time=time))
    expected = np.concatenate([pushed(LOG.q_nominal[:7, 0], 0.2), pushed(LOG.q_nominal[7:, 0], 0.2)])
    assert_array_equal(X[:, -1], expected - LOG.q_nominal[:, 0])


def test_signals_come_first_and_play_alone_cannot_leave_its_range() -> None:
    log = replace(LOG, tau=np.ones((12, 3)))
    features = FeatureSet(("q:J1", "tau:J1", "q:J2"), ("rad", "Nm", "rad"), play=(("q:J1", 0.1),))
    names = ("q:J1", "tau:J1", "q:J2", "play(q:J1, 0.1)")
    assert features.names == names
    assert features.feature_units == ("rad", "Nm", "rad", "rad")
    assert_array_equal(
        features.matrix(log)[:, :3], np.column_stack([log.q_nominal[:, 0], np.ones(12), log.q_nominal[:, 1]])
    )
    assert_array_equal(features.bounded, [name.startswith("play") for name in names])
    assert_array_equal(features.columns_of(["q:J1"]), [i for i, name in enumerate(names) if "q:J1" in name])


def test_words_choose_signals_groups_and_all_once_each() -> None:
    log = replace(LOG, qd=np.ones((12, 3)), tau=np.ones((12, 3)), signals={"current": np.ones(12)})
    assert choose_signals(log, ["tau", "q:J2"]) == ("tau:J1", "tau:J2", "tau:J3", "q:J2")
    assert choose_signals(log, ["all"]) == tuple(signals_of(log))
    assert len(signals_of(log)) == 10
    assert choose_signals(LOG, ["q:J2", "q", "all"]) == ("q:J2", "q:J1", "q:J3")


@pytest.mark.parametrize("word", ["tau", "qd:J1", "q:J9", "current", "", None])
def test_unknown_input_is_refused_with_those_there_are(word: str | None) -> None:
    known = "q:J1, q:J2, q:J3"
    message = f'no input "{word}"; it has {known}, and the groups q and all'
    with pytest.raises(InputError, match=message if word is not None else f"at least one of {known}"):
        choose_signals(LOG, [] if word is None else [word])


@pytest.mark.parametrize(
    ("signal", "changes", "message"),
    [
        ("tau:J1", {}, '"run": has no input "tau:J1"'),
        ("current", {"signals": {"current": np.array([1.0] * 3 + [np.nan] * 9)}}, 'rent" is nan at row 3'),
        ("current", {"signal_units": {"current": "mA"}}, 'input "current" is in "mA", expected "A"'),
    ],
)
def test_log_that_lacks_an_input_is_refused(signal: str, changes: dict[str, Any], message: str) -> None:
    with_current = {"signals": {"current": np.ones(12)}, "signal_units": {"current": "A"}}
    log = replace(LOG, **(with_current | changes if signal == "current" else {}))
    with pytest.raises(InputError, match=message):
        FeatureSet((signal,), ("A",)).matrix(log)


@pytest.mark.parametrize("every", [1, 3])
def test_pieces_of_a_recording_give_the_bits_of_the_whole(rng, monkeypatch, every) -> None:
    log = recording(rng, rows=500)
    q = np.array(log.q_nominal)
    q[260, 0] += 3.0  # a spike, and a gap in time, between and across pieces
    time = np.arange(500) * STEP + np.where(np.arange(500) >= 330, 60.0, 0.0)
    log = replace(log, q_nominal=q, time=time)
    features = choose_inputs(Recordings.of([log]), FitOptions(coupled=())).features
    whole = features.rows(log)
    monkeypatch.setattr(features_of_rows, "_PIECE_ROWS", 70)
    kept = np.arange(0, 500, every)
    parts = features.rows(log, kept if every > 1 else None)
    assert_array_equal(parts.X, whole.X[kept])
    assert_array_equal(parts.leaping, whole.leaping[kept])
    assert parts.spikes == whole.spikes
