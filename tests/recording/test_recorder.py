from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.raven2.topics import EXT_JPOS, raven_topics
from catenary.recording.bag_reader import JournalReader
from catenary.recording.recorder import Recorder
from oracles.raven_recording import ABOUT, record, telemetry


def test_tick_by_tick_and_all_at_once_give_the_same_messages(tmp_path: Path) -> None:
    time = 0.001 * np.arange(1500)
    columns = telemetry(time, np.random.default_rng(1))
    for name, split in (("once", [1500]), ("pieces", [1, 700, 701, 1500]), ("ticks", range(1, 1501))):
        with Recorder(tmp_path / name, raven_topics(), columns, np.random.default_rng(2), about=ABOUT) as recorder:
            for first, last in zip([0, *split], split, strict=False):
                recorder.observe_many(time[first:last], {k: v[first:last] for k, v in columns.items()})
    whole, pieces, ticks = (list(JournalReader(tmp_path / name).messages()) for name in ("once", "pieces", "ticks"))
    assert len(whole) > 300
    assert pieces == whole
    assert ticks == whole


def test_topics_come_at_their_rates_with_uneven_stamps(tmp_path: Path) -> None:
    record(tmp_path / "r", 20.0)
    stamps: dict[str, list[int]] = {}
    for topic, stamp, _ in JournalReader(tmp_path / "r").messages():
        stamps.setdefault(topic, []).append(stamp)
        stamps.setdefault("any", []).append(stamp)
    assert stamps["any"] == sorted(stamps["any"])
    for topic in raven_topics():
        intervals = np.diff(stamps[topic.name]) / 1e9
        assert_allclose(1.0 / intervals.mean(), topic.rate, rtol=0.02)  # jitter of 5 %, hundreds of intervals
        assert intervals.std() > 0.02 / topic.rate
        assert intervals.min() > 0.0


def test_what_a_robot_lacks_is_left_out_and_named(tmp_path: Path) -> None:
    with Recorder(tmp_path / "r", raven_topics(), ["jpos", "tau", "measured_js"], np.random.default_rng(0)) as recorder:
        recorder.observe_many(
            np.zeros(1), {"jpos": np.zeros((1, 16)), "tau": np.zeros((1, 16)), "measured_js": np.zeros((1, 7))}
        )
    assert [text.split(":")[0] for text in recorder.left_out] == ["/ext_jpos", "/joint_enc"]
    about = JournalReader(tmp_path / "r").about
    assert "encVals" in about.configuration["not_in_telemetry"]["/ravenstate"]


def test_a_robot_with_nothing_to_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no topic's columns"):
        Recorder(tmp_path / "r", raven_topics(), ["q"], np.random.default_rng(0))
    assert not (tmp_path / "r").exists()


@pytest.mark.parametrize(
    ("times", "rows", "message"),
    [
        *[(times, 2, "time") for times in ([0.0, 0.0], [0.1, 0.0], [np.nan, 1.0])],
        ([0.0, 0.1], 3, "3 rows, but 2 ticks"),
    ],
)
def test_telemetry_that_does_not_advance_with_time_is_refused(tmp_path, times, rows, message) -> None:
    with (
        Recorder(tmp_path / "r", (EXT_JPOS,), ["ext_jpos"], np.random.default_rng(0)) as recorder,
        pytest.raises(InputError, match=message),
    ):
        recorder.observe_many(np.array(times), {"ext_jpos": np.zeros((rows, 3))})


def test_a_robot_slower_than_the_topic_sends_every_sample_once(tmp_path: Path) -> None:
    time = 0.05 * np.arange(40)
    with Recorder(tmp_path / "r", (EXT_JPOS,), ["ext_jpos"], np.random.default_rng(0)) as recorder:
        recorder.observe_many(time, {"ext_jpos": np.zeros((40, 3))})
    assert len(list(JournalReader(tmp_path / "r").messages())) == 40
