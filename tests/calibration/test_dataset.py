from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.calibration.dataset import CalibrationData, calibration_data, data_notes
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.plant import MotionLog
from recordings import recording

NAMES, UNITS = ("q:J1", "q:J2", "q:J3"), ("rad", "rad", "m")
PLAIN = FeatureSet(NAMES, UNITS)


def run(seed: int = 0, rows: int = 50, bad: tuple[int, ...] = (), **changes: object) -> MotionLog:
    ok = np.ones(rows, dtype=bool)
    ok[list(bad)] = False
    return recording(np.random.default_rng(seed), rows=rows, ok=ok, name=f"run{seed}", **changes)


def kept_rows(data: CalibrationData, log: MotionLog, number: int = 0) -> np.ndarray:
    """Rows of the log that the data hold, found by their time stamps."""
    return np.searchsorted(log.time, data.time[data.recording == number])


@pytest.mark.parametrize(("began", "day"), [(1.7e9, "2023-11-14"), (0.0, None), (86_400.0, None)])
def test_rows_by_a_clock_that_counts_from_1970_have_a_date(began: float, day: str | None) -> None:
    assert calibration_data([run(began=began)], PLAIN).dates == (day, day)  # a robot's own clock has none


def test_rows_without_measurement_are_left_out_and_counted() -> None:
    log = run(bad=(1, 20, 21))
    data = calibration_data([log], PLAIN)
    assert_array_equal(kept_rows(data, log), np.delete(np.arange(50), [1, 20, 21]))
    assert data.sources[0].without_truth == 3


def test_rows_beyond_the_error_limit_are_dropped_and_counted() -> None:
    log = run(bad=(7,))
    q = log.q_nominal.copy()
    q[5, 0] += 0.2
    q[6, 2] -= 0.02
    q[7, 1] += 9.0  # no measurement: not counted twice
    q[8, 1] += 0.05
    data = calibration_data([replace(log, q_encoder=q)], PLAIN, max_error=np.array([0.1, 0.1, 0.01]))
    assert_array_equal(kept_rows(data, log), np.delete(np.arange(50), [5, 6, 7]))
    assert (data.sources[0].dropped, data.sources[0].without_truth) == (2, 1)


@pytest.mark.parametrize("held_out", [0.1, 0.2, 0.3, 0.5, 0.77])
def test_split_holds_out_the_end_of_every_recording(held_out: float) -> None:
    logs = [run(1, rows=50), run(2, rows=81)]
    early, late = calibration_data(logs, PLAIN).split_by_time(held_out)
    for number, log in enumerate(logs):
        first, last = kept_rows(early, log, number), kept_rows(late, log, number)
        assert_array_equal(np.concatenate([first, last]), np.arange(len(log)))
        assert abs(len(last) - held_out * len(log)) < 1.0


@pytest.mark.parametrize(
    ("held_out", "message"),
    [*[(share, "held-out share") for share in (0.0, 1.0, -0.2, 1.5, np.nan)], (0.1, "leaves no rows on one side")],
)
def test_held_out_share_that_is_none_or_leaves_a_side_empty_is_refused(held_out: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        calibration_data([run(bad=tuple(range(40, 50)))], PLAIN).split_by_time(held_out)


@pytest.mark.parametrize("count", [2, 5, 7])
def test_blocks_are_contiguous_and_cover_every_recording_alike(count: int) -> None:
    log = run(2, rows=81)
    for logs in ([log], [log, run(1, rows=14)], [log, run(1, rows=50, bad=(10, 11))]):
        data = calibration_data(logs, PLAIN)
        for number in range(len(logs)):
            numbers = data.blocks(count)[data.recording == number]
            assert np.all(np.diff(numbers) >= 0)  # rows are in order of time, so each block is one stretch
            assert set(numbers) == set(range(count))
            assert np.ptp(np.bincount(numbers)) <= 1 + int((~logs[number].ok).sum())


SHORT = r"6 rows, 6 without measurement, 0 beyond"


@pytest.mark.parametrize(
    ("logs", "message"),
    [([replace(run(), q_encoder=None)], '"run0": has no q_encoder'), ([run(rows=6, bad=range(6))], SHORT)],
)
def test_recordings_that_give_no_data_are_refused(logs: list[MotionLog], message: str) -> None:
    with pytest.raises(InputError, match=message):
        calibration_data(logs, PLAIN)


def test_every_third_row_is_what_all_rows_say_there(rng) -> None:
    log = recording(rng, rows=300)
    features = choose_inputs(Recordings.of([log]), FitOptions(kind="linear", play=(0.1,))).features
    limits = np.quantile(np.abs(log.q_encoder - log.q_nominal), 0.9, axis=0)
    everything = calibration_data([log], features, max_error=limits)
    third = calibration_data([log], features, max_error=limits, every=3)
    same = np.isin(everything.position, third.position)
    for name in ("X", "error", "time", "position", "recording"):
        assert_array_equal(getattr(third, name), getattr(everything, name)[same])
    assert third.sources[0].rows == 100
    assert len(third) + third.sources[0].dropped == 100
    assert "of 300 rows one in 3 is learnt from; memory follows them all" in data_notes([log], third)
