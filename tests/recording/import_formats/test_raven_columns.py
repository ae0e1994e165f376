import csv
import hashlib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rosbags.highlevel import AnyReader

from catenary.errors import FileFormatError, InputError
from catenary.recording.extract import extract
from catenary.recording.import_formats.raven_recordings import read_raven, write_raven_csv
from catenary.recording.logs import read_log
from oracles.raven_recording import START_NS, record, write_bag

# the published layout: first and last column of each field of raven_state
LAYOUT = {
    "jpos": (13, 28), "runlevel": (29, 29), "sublevel": (30, 30), "last_seq": (31, 31), "type": (32, 33),
    "pos": (34, 39), "ori": (40, 57), "ori_d": (58, 75), "pos_d": (76, 81), "encVals": (82, 97),
    "dac_val": (98, 113), "tau": (114, 129), "mpos": (130, 145), "mvel": (146, 161), "jvel": (162, 177),
    "mpos_d": (178, 193), "jpos_d": (194, 209), "grasp_d": (210, 211), "encoffsets": (212, 227),
    "jac_vel": (228, 239), "jac_f": (240, 251),
}  # fmt: skip


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    return write_bag(record(folder / "journal", 6.0), folder / "a.bag")


@pytest.fixture(scope="module")
def extraction(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return extract([bag], tmp_path_factory.mktemp("extraction") / "x").folder


@pytest.fixture
def table(extraction: Path, tmp_path: Path) -> Path:
    """The extraction in the published layout."""
    write_raven_csv(extraction, tmp_path / "a.csv")
    return tmp_path / "a.csv"


def _rows(path: Path) -> list[list[str]]:
    with path.open(newline="") as file:
        return list(csv.reader(file))


def _write(rows: list[list[str]], path: Path) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def test_every_column_is_the_messages_number_in_its_published_place(bag: Path, table: Path) -> None:
    rows = _rows(table)
    assert {len(row) for row in rows} == {252}
    with AnyReader([bag]) as reader:
        messages = {
            each.topic: [reader.deserialize(data, each.msgtype) for _, _, data in reader.messages([each])]
            for each in reader.connections
        }
    for row, state in zip(rows, messages["/ravenstate"], strict=True):
        for field, (first, last) in LAYOUT.items():
            value = np.atleast_1d(getattr(state, field))
            written = np.array([float(text) for text in row[first : last + 1]]).astype(value.dtype)
            assert_array_equal(written, value, err_msg=field)  # float32 and whole numbers: to the bit
        stamp = state.hdr.stamp.sec + state.hdr.stamp.nanosec * 1e-9
        assert_allclose(float(row[12]), stamp, atol=1e-6)  # seconds since 1970 in a double
        for topic, stamp_column, origin, width in (
            ("/ext_jpos", 0, START_NS / 1e9, 3),
            ("/arm2/measured_js", 4, 0.0, 7),
        ):
            stamps = [message.header.stamp for message in messages[topic]]
            times = np.array([each.sec + each.nanosec * 1e-9 for each in stamps])
            nearest = int(np.argmin(np.abs(times - stamp)))
            got = float(row[stamp_column]) + origin
            assert_allclose(abs(got - stamp), abs(times[nearest] - stamp), atol=2e-6)
            same = int(np.argmin(np.abs(times - got)))
            numbers = [float(text) for text in row[stamp_column + 1 : stamp_column + 1 + width]]
            assert_array_equal(numbers, messages[topic][same].position)


def test_jpos_is_times_180_over_pi_in_metres_too(table: Path) -> None:
    insertion = np.array([float(row[15]) for row in _rows(table)])
    assert (insertion > 18.0).all()  # 0.33 m and more, as if they were radians
    log = read_raven([table]).log
    assert (log.q_nominal[:, 2] < 0.42).all()


def test_the_csv_reads_back_as_the_log_of_the_recording(extraction: Path, table: Path) -> None:
    expected = read_raven([extraction]).log
    log = read_raven([table]).log
    assert log.tau is not None
    assert expected.tau is not None
    assert_array_equal(log.q_nominal, expected.q_nominal)
    assert_array_equal(log.tau, expected.tau)
    assert list(log.signals) == list(expected.signals)
    both = log.ok & expected.ok
    assert both[1:-1].all()
    # samples of 100 Hz at 30 Hz: chords of up to 45 ms, 0.4 rad at 0.31 rad/s
    assert_allclose(log.q_encoder[both], expected.q_encoder[both], atol=0.045**2 / 8 * 0.4 * 0.31**2)  # type: ignore[index]


def test_every_column_of_the_csv_is_read_on_request(extraction: Path, table: Path) -> None:
    expected = read_raven([extraction], columns=("all",)).log
    log = read_raven([table], columns=("all",)).log
    assert set(expected.signals) - set(log.signals) == {"dt"}  # not in the layout
    for name in ("encVals:elbow", "green_mpos:shoulder", "pos:x", "mvel:jaw1"):
        assert_array_equal(log.signals[name], expected.signals[name])


def test_the_csv_opens_as_a_recording_that_knows_its_file(table: Path) -> None:
    log, expected = read_log(table), read_raven([table]).log
    assert log.joint_names == ("shoulder", "elbow", "insertion")
    assert_array_equal(log.q_encoder, expected.q_encoder)
    assert log.sha256 == hashlib.sha256(table.read_bytes()).hexdigest()
    for given in ({"units": ["rad", "rad", "rad"]}, {"joint_names": ["a", "b", "c"]}):
        with pytest.raises(InputError, match="those given are"):
            read_log(table, **given)


def test_force_in_256_columns_is_read_as_signals(table: Path, tmp_path: Path) -> None:
    rows = _rows(table)
    for i, row in enumerate(rows):
        row += [row[12], "1.5", str(i), str(-i)]  # as of the state's stamp
    _write(rows, tmp_path / "b.csv")
    log = read_raven([tmp_path / "b.csv"]).log
    assert_array_equal(log.signals["force_x"], np.full(len(log), 1.5))
    assert_array_equal(log.signals["force_y"], np.arange(len(log)))
    assert log.signal_units["force_z"] == "N"


def test_stamps_that_all_count_from_the_first_state_read_the_same(table: Path, tmp_path: Path) -> None:
    rows = _rows(table)
    origin = float(rows[0][12])
    for row in rows:
        row[4], row[12] = (repr(float(row[i]) - origin) for i in (4, 12))
    _write(rows, tmp_path / "b.csv")
    a, b = read_raven([table]).log, read_raven([tmp_path / "b.csv"]).log
    assert_allclose(a.time, b.time, atol=1e-6)
    assert_allclose(a.q_encoder, b.q_encoder, atol=1e-6, equal_nan=True)


def test_a_line_of_names_is_passed_over(table: Path, tmp_path: Path) -> None:
    text = table.read_text()
    (tmp_path / "b.csv").write_text(NAMES + text)
    assert len(read_raven([tmp_path / "b.csv"]).log) == len(read_raven([table]).log)


def test_rows_without_an_encoder_near_are_written_as_nan_and_not_trusted(extraction, tmp_path) -> None:
    write_raven_csv(extraction, tmp_path / "a.csv", max_gap=0.0001)
    rows = _rows(tmp_path / "a.csv")
    lonely = [row[0] == "nan" for row in rows]
    assert any(lonely)
    assert not all(lonely)
    result = read_raven([tmp_path / "a.csv"])
    assert result.without_encoder > 0
    assert len(result.log) == len(rows)


NAMES = ",".join(f"c{i}" for i in range(252)) + "\n"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "1,2,3\n", "3 columns, expected RAVEN-II's 252, or 256"),
        (lambda text: text[:-300], "cannot be read as RAVEN-II's CSV"),
        (lambda text: text[:5000] + "oops" + text[5000:], "oops"),
        (lambda text: NAMES, "no rows"),
    ],
    ids=["columns", "cut off", "text", "names alone"],
)
def test_what_is_no_table_of_numbers_is_refused(table, change, message) -> None:
    table.write_text(change(table.read_text()))
    with pytest.raises((FileFormatError, InputError), match=message):
        read_raven([table])


def test_a_missing_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        read_raven([tmp_path / "b.csv"])
