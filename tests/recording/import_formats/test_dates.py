"""A recording with stamps since 1970 keeps its date; a clock of its own has none."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pytest

from catenary.calibration.dataset import calibration_data
from catenary.calibration.features import FeatureSet
from catenary.recording.logs import read_log, write_parquet
from catenary.workflows.import_recording import import_recording
from lab_bags import two_topics

DAY, BEGIN = "2023-11-14", 1_700_000_000  # [s] 22:13:20 UTC
PER = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
MAPPING = ["q_nominal=q1,q2,q3", "q_encoder=e1,e2,e3"]


def columns(begin: int, unit: str = "s") -> dict[str, np.ndarray]:
    t = np.arange(600) * 10  # [ms]
    time = begin * PER[unit] + t * (PER[unit] // 1000) if unit != "s" else begin + t / 1000
    q = np.sin(t[:, None] / 1000 + np.arange(3))
    named = {f"q{j + 1}": q[:, j] for j in range(3)} | {f"e{j + 1}": 1.01 * q[:, j] + 0.02 for j in range(3)}
    return {"time": np.asarray(time), **named}


def csv(path: Path, begin: int, unit: str = "s") -> Path:
    pa.csv.write_csv(pa.table(columns(begin, unit)), path / "lab.csv")
    return path / "lab.csv"


def date_of(log) -> str | None:  # type: ignore[no-untyped-def]
    data = calibration_data([log], FeatureSet(tuple(f"q:{n}" for n in log.joint_names), log.joint_units))
    assert data.dates[0] == data.dates[1]
    return data.dates[1]


@pytest.mark.parametrize(  # a robot's own clock has none
    ("begin", "unit", "day"),
    [(BEGIN, "s", DAY), (BEGIN, "ms", DAY), (BEGIN, "ns", DAY), (0, "s", None), (86_400, "s", None)],
)
def test_a_column_of_time_since_1970_is_a_date(begin: int, unit: str, day: str | None, tmp_path: Path) -> None:
    log = import_recording(csv(tmp_path, begin, unit), MAPPING, units="rad,rad,m")
    assert log.time is not None
    assert (log.time[0], log.began, date_of(log)) == (0.0, begin, day)
    write_parquet(log, tmp_path / "log.parquet")
    assert date_of(read_log(tmp_path / "log.parquet")) == day


def test_a_bag_has_the_date_of_its_stamps(tmp_path: Path) -> None:
    mapping = ["q_nominal=/raven/joint_cmd.position", "q_encoder=/optitrack/joints.position"]
    assert date_of(import_recording(two_topics(tmp_path / "lab", "mcap"), mapping, units="rad,rad,m")) == DAY


def test_rows_of_a_given_rate_have_no_date(tmp_path: Path) -> None:
    pa.csv.write_csv(pa.table(columns(BEGIN)).drop_columns("time"), tmp_path / "lab.csv")
    mapping = {
        "q_nominal": {"columns": ["q1", "q2", "q3"], "units": ["rad", "rad", "m"]},
        "q_encoder": {"columns": ["e1", "e2", "e3"], "units": ["rad", "rad", "m"]},
        "rate_hz": 100.0,
    }
    assert date_of(import_recording(tmp_path / "lab.csv", mapping)) is None
