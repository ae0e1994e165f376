"""What a text table's first and last lines say, and that no text at all breaks its reader."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.csv_files import date_format, read_head
from catenary.workflows.import_recording import propose_mapping

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
