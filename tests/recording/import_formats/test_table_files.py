"""Tables of many makes, written by the libraries that people use for them; what a text's first and last lines say."""

import gzip
import struct
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.io import savemat

from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.csv_files import date_format, read_head
from catenary.workflows.check import check_file
from catenary.workflows.import_recording import import_recording, propose_mapping
from lab_bags import true_q

T = np.arange(0.0, 6.0, 0.01)
Q = true_q(T)
SEEN = Q + np.array([0.01, -0.02, 0.002])
DEG = np.array([180 / np.pi, 180 / np.pi, 1000.0])
NAMES = ("shoulder", "elbow", "insertion")


def write_csv(
    path: Path, names: list[str], columns: list[np.ndarray], separator: str = ",", decimal: str = "."
) -> Path:
    rows = [separator.join(f"{v:.9f}".replace(".", decimal) for v in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([separator.join(names), *rows]) + "\n")
    return path


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
@pytest.mark.parametrize("since", [0.0, 1.7e9])
def test_the_unit_of_time_is_told_by_the_rate_or_the_epoch_and_said(
    unit: str, scale: float, since: float, tmp_path: Path
) -> None:
    path = tmp_path / "lab.csv"
    if unit == "ns" and not since:
        pytest.skip("whole numbers from a zero of their own are asked: test_table_time.py")
    begin = since if since or unit == "s" else 0.25 / scale  # no whole numbers
    stamps = [str(round((begin + t) * 1e9)) if unit == "ns" else f"{(begin + t) * scale:.6f}" for t in T]
    rows = [f"{s},{a:.9f},{b:.9f}" for s, a, b in zip(stamps, Q[:, 0], Q[:, 1], strict=True)]
    path.write_text("t,q1,q2\n" + "\n".join(rows) + "\n")
    log = import_recording(path, ["q_nominal=q1,q2"], units="rad")
    assert_allclose(log.time, T, atol=1e-6)
    assert any(f"time is t in {unit}" in note for note in log.notes)
    assert log.began == pytest.approx(begin, abs=1e-9)


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
@pytest.mark.parametrize("name", ["", "stamp"])
def test_dates_of_a_data_frame_are_the_time(name: str, zone: str, tmp_path: Path) -> None:
    begin = np.datetime64("2026-03-29T00:59:58", "ns")  # an hour later clocks went forwards
    dates = begin + np.round(T * 1e9).astype("timedelta64[ns]")
    told = [str(date).replace("T", " ").removesuffix(".000000000") + zone for date in dates]
    rows = [f"{d},{a:.9f},{b:.9f}" for d, a, b in zip(told, Q[:, 0], Q[:, 1], strict=True)]
    path = tmp_path / "frame.csv"
    path.write_text(f"{name},q1,q2\n" + "\n".join(rows) + "\n")
    log = import_recording(path, ["q_nominal=q1,q2"], units="rad")
    assert_allclose(log.time, T, atol=1e-6)
    assert any(f"{name or 'time'}: holds dates" in note for note in log.notes)


def test_an_index_of_dates_without_a_name_is_the_time_of_a_parquet_file(tmp_path: Path) -> None:
    dates = pa.array(np.round((1.7e9 + T) * 1e9).astype(np.int64), pa.timestamp("ns"))
    table = pa.table({"q1": Q[:, 0], "q2": Q[:, 1], "__index_level_0__": dates})
    pq.write_table(table, tmp_path / "frame.parquet")
    log = import_recording(tmp_path / "frame.parquet", ["q_nominal=q1,q2"], units="rad")
    assert_allclose(log.time, T, atol=1e-6)


def test_a_first_line_that_tells_spreadsheets_the_separator_is_no_line_of_names(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "lab.csv", ["t [s]", "q1", "q2"], [T, Q[:, 0], Q[:, 1]], separator=";", decimal=",")
    table.write_text("sep=;\n" + table.read_text())
    assert_allclose(import_recording(table, ["q_nominal=q1,q2"], units="rad").q_nominal, Q[:, :2], atol=1e-9)


def test_a_unit_of_time_that_cannot_be_told_is_asked(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "lab.csv", ["t", "q1", "q2"], [np.arange(600.0), Q[:, 0], Q[:, 1]])
    with pytest.raises(InputError, match=r"unit of time t cannot be inferred, rows are 1 apart.*ms \(1000 Hz\)"):
        import_recording(table, ["q_nominal=q1,q2"], units="rad")
    log = import_recording(table, ["q_nominal=q1,q2", "time=t@ms"], units="rad")
    assert log.time[-1] == pytest.approx(0.599)
    even = {"q_nominal": {"columns": ["q1", "q2"], "units": "rad"}, "rate_hz": 100.0}
    assert import_recording(table, even).began == 0.0


def test_names_that_are_there_twice_are_numbered(tmp_path: Path) -> None:
    table = write_csv(tmp_path / "lab.csv", ["t", "q", "q", "q"], [T, *Q.T])
    log = import_recording(table, ["q_nominal=q,q#2,q#3"], units="rad,rad,m")
    assert_allclose(log.q_nominal, Q, atol=1e-9)
    assert any("numbered" in note for note in log.notes)


def test_rows_repeated_or_without_numbers_are_told_and_time_that_goes_back_begins_a_recording(tmp_path: Path) -> None:
    time, q = T[:100].copy(), Q[:100].copy()
    time[50:] -= 0.3
    time[11] = time[10]
    q[20, 1] = np.nan
    table = write_csv(tmp_path / "lab.csv", ["t", "a", "b"], [time, q[:, 0], q[:, 1]])
    log = import_recording(table, ["q_nominal=a,b"], units="rad")
    assert len(log) == 98
    assert len(log.starts) == 2
    said = " ".join(log.notes)
    for words in ("1 repeated stamps were dropped", "1 of 99 rows without q_nominal", "time goes back 1 time"):
        assert words in said


def of_matlab(path: Path) -> Path:
    content = {"log": {"time": T[:, np.newaxis], "cmd": Q, "optitrack": SEEN.T}, "note": "a text"}
    content |= {"cells": np.array(["lost", Q[:2]], dtype=object), "images": np.zeros((2, 3, 4))}
    savemat(path.with_suffix(".mat"), content, do_compression=True)
    return path.with_suffix(".mat")


def test_arrays_of_matlab_are_read_by_name_within_its_structures(tmp_path: Path) -> None:
    table = of_matlab(tmp_path / "lab")
    log = import_recording(table, ["q_nominal=log.cmd", "q_encoder=log.optitrack"], units="rad,rad,m")
    assert_allclose(log.time, T, atol=1e-9)
    assert_allclose(log.q_nominal, Q)
    assert_allclose(log.q_encoder, SEEN)
    assert any("numbers were left out: cells, images" in note for note in log.notes)
    with pytest.raises(InputError, match="open questions: the units of q_nominal"):
        import_recording(table, accept_proposal=True)
    assert "optitrack[0]" in propose_mapping(table, units="rad,rad,m").toml


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("lab.xlsx", "is a spreadsheet: save its sheet as CSV"),
        ("lab.XLS", "is a spreadsheet: save its sheet as CSV"),
        ("lab.zip", "is packed: unpack it first"),
        ("lab.tar.xz", "is packed: unpack it first"),
        ("lab.pkl", "is a pickle, which may run code.*numpy"),
        ("lab.tdms", "is LabVIEW's: nptdms"),
        ("lab.feather", "is Arrow's: pandas"),
    ],
)
def test_files_that_nothing_here_reads_are_refused_with_a_way_to_one_that_is(
    name: str, words: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_bytes(b"PK\x03\x04 and more")
    for read in (propose_mapping, check_file):
        with pytest.raises(FileFormatError, match=words):
            read(str(tmp_path / name))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"no gzip", r"run\.csv\.gz: cannot be unpacked"),
        (gzip.compress(b"a,b\n1,2\n3,4\n")[:-9], r"run\.csv\.gz: cannot be unpacked"),
        (gzip.compress(bytes(2**20)), r"run\.csv\.gz: .*"),
        (gzip.compress(bytes(129 * 2**20), 1), "unpacks to more than 134217728 bytes"),
    ],
    ids=["no gzip", "cut", "no table", "large"],
)
def test_a_packed_csv_that_is_damaged_or_too_large_is_refused_by_its_own_name(
    content: bytes, words: str, tmp_path: Path
) -> None:
    (tmp_path / "run.csv.gz").write_bytes(content)
    with pytest.raises(FileFormatError, match=words):
        propose_mapping(tmp_path / "run.csv.gz")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "expected a line of names, if any"),
        (b"\xff\xfea\0", "expected"),
        (b"a,b\n" + b"\0" * 20 + b"\n", "no text"),
        (b"a,b\nx,y\nz,w\n", "no column of numbers"),
        (b"a" * 2_000_000 + b"\n1\n", "a line of more than"),
        (b"a,b\n1,2\n3\n", "cannot be read as CSV"),
        (",".join(f"c{i}" for i in range(6000)).encode() + b"\n" + b",".join([b"1"] * 6000), "6000 columns"),
    ],
)
def test_what_is_no_table_is_refused_in_words(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "lab.csv").write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        propose_mapping(tmp_path / "lab.csv")


@pytest.mark.parametrize("ending", [".mat", ".npz", ".npy", ".parquet", ".bag", ".mcap", ".db3", ".csv"])
def test_bytes_of_no_file_are_refused(ending: str, tmp_path: Path, rng: np.random.Generator) -> None:
    for size in (0, 10, 600, 5000):
        (tmp_path / f"lab{ending}").write_bytes(rng.bytes(size))
        with pytest.raises(FileFormatError):
            propose_mapping(tmp_path / f"lab{ending}")


def test_small_files_that_state_large_counts_are_refused_before_room_is_made_for_them(tmp_path: Path) -> None:
    content = np.empty((1, 3), dtype=object)
    content[:] = [[1.0, 2.0, 3.0]]
    savemat(tmp_path / "cells.mat", {"c": content})
    data = (tmp_path / "cells.mat").read_bytes()
    (tmp_path / "cells.mat").write_bytes(data.replace(struct.pack("<ii", 1, 3), struct.pack("<ii", 2**15, 2**15)))
    schema = pa.schema([(f"c{i}", pa.float64()) for i in range(20_000)])
    pq.ParquetWriter(tmp_path / "wide.parquet", schema).close()
    np.savez(tmp_path / "none.npz", q=np.empty((0, 2**23)))
    for name, said in (
        ("cells.mat", r"an array of shape \(32768, 32768\)"),
        ("wide.parquet", "20000 columns, expected 5000 at most"),
        ("none.npz", "holds no array of numbers"),
    ):
        with pytest.raises(FileFormatError, match=said):
            propose_mapping(tmp_path / name)


def test_damaged_matlab_files_are_refused_or_read(tmp_path: Path, rng: np.random.Generator) -> None:
    whole = of_matlab(tmp_path / "lab").read_bytes()
    for _ in range(60):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), 3):
            data[place] = rng.integers(256)
        (tmp_path / "bad.mat").write_bytes(bytes(data[: rng.integers(100, len(data))]))
        try:
            propose_mapping(tmp_path / "bad.mat")
        except (FileFormatError, InputError):
            continue


def test_control_characters_in_names_stay_out_of_the_proposal(tmp_path: Path) -> None:
    names = ["t", "cmd_a\x1b\x07", "cmd_b", "camera_a\x1b\x07", "camera_b"]
    table = write_csv(tmp_path / "lab.csv", names, [T, Q[:, 0], Q[:, 1], SEEN[:, 0], SEEN[:, 1]])
    proposal = propose_mapping(table, units="rad")
    assert not any(ord(letter) < 32 and letter != "\n" for letter in proposal.toml)
    log = import_recording(table, proposal.accepted())
    assert_allclose(log.q_nominal, Q[:, :2], atol=1e-9)


CELLS = st.sampled_from(
    ["", "0.5", "-1e3", "nan", "x", "2026-03-04", "03/04/2026", "12:30:01", "1700000000", "true", '"', "é"]
)
SEPARATORS = st.sampled_from([",", ";", "\t", " ", ", "])


@settings(max_examples=60, deadline=None)
@given(
    mark=st.sampled_from(["", "# ", "% ", "//", "sep=;\n"]),
    rows=st.lists(st.lists(CELLS, max_size=5), max_size=8),
    separator=SEPARATORS,
)
@example(mark="", rows=[["", "", "", "12:30:01", ""], ["", "", "2026-03-04", "", ""]], separator=",")
def test_any_table_of_text_is_read_or_refused(
    mark: str, rows: list[list[str]], separator: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path: Path = tmp_path_factory.mktemp("any") / "lab.csv"
    path.write_text(mark + "\n".join(separator.join(row) for row in rows))
    try:
        propose_mapping(path)
    except (FileFormatError, InputError):
        return


@pytest.mark.parametrize(
    ("lines", "names"),
    [
        ("t q1\n0 1\n1 2", ["t", "q1"]),
        ("# t, q1\n0 1\n1 2", ["t", "q1"]),
        ("# 2026 at the lab\n# t q1\n0 1\n1 2", ["t", "q1"]),
        ("t,q1\n(s),(deg)\n0,1\n1,2", ["t [s]", "q1 [deg]"]),
        ("t [ms],q1\n-,rad\n0,1\n1,2", ["t [ms]", "q1 [rad]"]),
        ("t,q1,\n0,1,\n1,2,", ["t", "q1"]),
        ("t,q,,,f,,\n0,1,2,3,4,5,6\n1,2,3,4,5,6,7", ["t", "q[0]", "q[1]", "q[2]", "f[0]", "f[1]", "f[2]"]),
        ("t,q1,,,,,\n0,1,2,3,4,5,6\n1,2,3,4,5,6,7", [f"data[{i}]" for i in range(7)]),
        ("t,q1,q2\n0,1\n1,2", ["data[0]", "data[1]"]),
        ("0;1,5\n1;2,5", ["data[0]", "data[1]"]),
        ("Recorded by a student\n\nt,note,q1\n0,begin,1\n1,,2", ["t", "note", "q1"]),
    ],
)
def test_names_are_those_above_the_rows(lines: str, names: list[str]) -> None:
    assert [column.name for column in read_head("lab", lines.split("\n")).columns] == names


@pytest.mark.parametrize(
    ("line", "torn"), [("2,5", False), ("2,", False), ("2", True), ("2,-", True), ("2,1e-", True), ("2,\0\0", True)]
)
def test_a_last_line_without_an_end_is_torn_where_it_lacks_cells_or_one_is_no_number(line: str, torn: bool) -> None:
    head = read_head("lab", ["t,q1", "0,1", "1,2"], unended=line)
    assert head.torn == (line if torn else "")
    assert [column.kind for column in head.columns] == ["number", "number"]


@pytest.mark.parametrize(
    ("last", "torn"), [("0.1234", False), ("0.12", True), ("0.", True), ("0", True), ("-0.5555", False), ("nan", False)]
)
def test_a_number_cut_within_its_digits_is_torn_where_all_others_have_more(last: str, torn: bool) -> None:
    rows = [f"{0.01 * i:.2f},{np.sin(i):.4f}" for i in range(40)]
    line = f"0.40,{last}"
    assert read_head("lab", ["t,q1", *rows], unended=line).torn == (line if torn else "")


@pytest.mark.parametrize(
    ("texts", "order", "doubt"),
    [
        (["2026-03-04", "2026-03-05"], "ymd", False),
        (["04.03.2026"], "dmy", False),
        (["13/04/2026", "01/05/2026"], "dmy", False),
        (["04/13/2026", "05/01/2026"], "mdy", False),
        (["03/04/2026", "04/04/2026"], "dmy", False),  # a day, or a month
        (["03/04/2026", "03/05/2026"], "mdy", False),
        (["04/04/2026"], "dmy", False),
        (["03/04/2026"], "dmy", True),
        (["4-Mar-2026 10:00"], "dmy", False),
        (["10:00:00.5", "10:00:01"], "", False),
        *((texts, None, False) for texts in (["1.5", "2.5"], ["2026-03-04", "12"], [])),  # no dates
    ],
)
def test_the_order_of_day_and_month_is_told_or_is_a_doubt(texts: list[str], order: str | None, doubt: bool) -> None:
    form = date_format(texts)
    assert (None if form is None else form.order, bool(form and form.doubt)) == (order, doubt)


@pytest.mark.parametrize(
    "cell",
    ["1.#QNAN", "-1.#IND", "-1.#IND00", "1.#INF00", "1.#QNAN0", "-nan(ind)", "#DIV/0!", "Missing", "", "-9999", "-999.000",
     "-3.697314E28", "-3.697314E+28", "1e30", "65535"],
)  # fmt: skip
@pytest.mark.parametrize("given", [None, ["q_nominal=q1,q2,q3", "q_encoder=cam1,cam2,cam3"]])
def test_a_cell_that_means_missing_is_no_measurement(cell: str, given: list[str] | None, tmp_path: Path) -> None:
    """Among the first rows and behind them; units are told as if it were not there."""
    rows = [[f"{v:.6f}" for v in row] for row in np.column_stack([T, Q, SEEN])]
    gone = [*range(3, 8), *range(400, 430)]
    for row in gone:
        rows[row][5] = cell
    path = tmp_path / "lab.csv"
    path.write_text("\n".join(["t,q1,q2,q3,cam1,cam2,cam3", *map(",".join, rows)]) + "\n")
    log = import_recording(path, given, units="rad,rad,m", accept_proposal=True)
    assert np.flatnonzero(~log.ok).tolist() == gone
    assert_allclose(log.q_encoder[log.ok], SEEN[log.ok], atol=1e-6)
    assert any("rows have no q_encoder (J2 35)" in note for note in log.notes)
