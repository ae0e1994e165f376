import base64
import io
import re
from datetime import date
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from catenary import __version__
from catenary.errors import FileFormatError
from catenary.reports import page
from catenary.reports.robot_plot import _AXIS_COLORS
from catenary.tables import Table

NASTY = "<script>alert('x')</script> & \"quotes\" µ ±"


def written(path: Path, blocks: list[page.Block], *, simulated: bool = False) -> str:
    page.write_page(path, "Title", "lead", blocks, simulated=simulated)
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "block",
    [page.Heading(NASTY), page.Text(NASTY), Table([NASTY], [[NASTY]]), page.Facts([(NASTY, NASTY)]), page.Remarks([NASTY]), page.Listing(NASTY, NASTY)],
    ids=lambda block: type(block).__name__,
)  # fmt: skip
def test_text_is_escaped(tmp_path: Path, block: page.Block) -> None:
    text = written(tmp_path / "p.html", [block])
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "µ ±" in text


def test_pictures_are_inside_the_page_with_words_for_who_does_not_see_them(tmp_path: Path) -> None:
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    blocks: list[page.Block] = [page.picture(figure, NASTY, "what is drawn"), page.Picture("", "only a caption")]
    text = written(tmp_path / "p.html", blocks)
    assert 'alt="what is drawn"' in text
    assert 'alt="only a caption"' in text
    found = re.search(r'src="data:image/png;base64,([^"]+)"', text)
    assert found
    image = matplotlib.image.imread(io.BytesIO(base64.b64decode(found.group(1))))
    assert image.shape[:2] == (150, 300)  # 150 dots per inch


def test_simulated_data_are_marked_and_real_ones_are_not(tmp_path: Path) -> None:
    assert "Simulated: no real robot" in written(tmp_path / "p.html", [], simulated=True)
    real = written(tmp_path / "p.html", [page.Text("x")])
    # nothing outside either
    assert not re.search(r"Simulated|https?:|src=|href=|<script|@import|url\(", real)


def test_names_that_are_no_text_do_not_stop_the_page(tmp_path: Path) -> None:
    assert r"run\udcff" in written(tmp_path / "p.html", [page.Text("run\udcff")])


def test_a_page_that_cannot_be_written_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"p\.html: cannot be written"):
        written(tmp_path / "nowhere" / "p.html", [])


def test_settings_are_shown_without_brackets_digits_of_rounding_and_what_is_not_set() -> None:
    settings = {"base_tilt_deg": (0.0, -20.0), "seed": None, "names": ["pd", "sg"], "third": 1 / 3}
    facts = page.settings_facts(settings)
    assert facts.rows == [("base tilt deg", "0, -20"), ("names", "pd, sg"), ("third", "0.333333")]


def test_verdict_and_date_stand_first_and_blocks_in_their_order(tmp_path: Path) -> None:
    path, blocks = tmp_path / "p.html", [page.Heading("one"), page.Text("two"), Table(["h"], [["three"]])]
    page.write_page(path, "Title", "lead", [*blocks, page.Text("four")], verdict=NASTY, made=date(2026, 5, 14))
    text = path.read_text()
    words = (">Title<", 'class="verdict"', ">lead<", "2026-05-14", ">one<", ">two<", ">h<", ">three<", ">four<")
    places = [text.index(word) for word in (*words, f">catenary {__version__}<")]
    assert places == sorted(places)
    assert NASTY not in text


def test_columns_of_a_table_line_up() -> None:
    assert Table(["name", "J1 [deg]"], [["a", "1.0"], ["longer", "12.345"]], "Title").text() == (
        "Title\n\n"
        "  name        J1\n"
        "           [deg]\n"
        "  ------  ------\n"
        "  a          1.0\n"
        "  longer  12.345\n"
    )  # fmt: skip


def test_a_wide_table_is_not_cut_and_a_cell_stays_on_its_line() -> None:
    assert "29.123" in Table([f"c{i}" for i in range(30)], [[f"{i}.123" for i in range(30)]]).text()
    assert Table(["name"], [["[red]a[/red] [rad]"], ["b\nc"]]).text().endswith("  [red]a[/red] [rad]\n  b c\n")


def test_a_column_says_what_of_a_record_stands_in_it_and_how() -> None:
    columns = [("joint", "name"), ("error [deg]", "error:.2f"), ("share", "share:.0f %")]
    records = [{"name": "J1", "error": 1.234, "share": 0.5}, {"name": "J2", "error": None, "share": np.nan}]
    table = Table(columns, records)
    assert table.header == ["joint", "error [deg]", "share"]
    assert table.rows == [["J1", "1.23", "50 %"], ["J2", "-", "-"]]


def test_a_figure_of_hours_is_small_and_holds_its_fonts(tmp_path: Path) -> None:
    x = np.linspace(0.0, 4000.0, 60_000)
    figure, panels = page.joint_panels([("J1", "deg"), ("J2", "deg")], 2.0)
    for axes in panels[:, 0]:
        axes.plot(x, np.random.default_rng(0).normal(size=x.shape), label="raw")
        axes.plot(x[:1800].reshape(-1, 2), np.sin(x[:1800]).reshape(-1, 2), ".")
        axes.fill_between(x, np.sin(x) - 1.0, np.sin(x) + 1.0)
    for ending in (".pdf", ".svg"):
        page.write_picture(figure, tmp_path / f"f{ending}", (".pdf", ".svg"))
        assert (tmp_path / f"f{ending}").stat().st_size < 300_000
    assert b"/FontFile2" in (tmp_path / "f.pdf").read_bytes()
    assert "<text" not in (tmp_path / "f.svg").read_text()  # outlines: no font is looked for


@pytest.mark.parametrize("colours", [(page.GREY, page.BLUE, page.ORANGE), [*_AXIS_COLORS.values()]])
def test_colours_that_are_drawn_together_differ_in_print_without_colours(colours) -> None:
    def lightness(colour: str) -> float:  # L* of CIELAB, 0 to 100
        channels = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        return float(116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0)

    steps = np.diff(sorted(map(lightness, colours)))
    assert (steps > 12.0).all()  # 2 are just told apart side by side; thin lines need more
    assert max(map(lightness, colours)) < 80.0  # on white
