import base64
import io
import re
from pathlib import Path

import matplotlib.image
import pytest
from matplotlib.figure import Figure

from catenary import __version__
from catenary.errors import FileFormatError
from catenary.reports.page import (
    Block,
    Facts,
    Heading,
    Listing,
    Remarks,
    Table,
    Text,
    picture,
    settings_facts,
    write_page,
)

NASTY = "<script>alert('x')</script> & \"quotes\" µ ±"


def page(path: Path, blocks: list[Block], *, simulated: bool = False) -> str:
    write_page(path, "Title", "lead", blocks, simulated=simulated)
    return path.read_text(encoding="utf-8")


def test_blocks_stand_in_their_order(tmp_path: Path) -> None:
    text = page(tmp_path / "p.html", [Heading("one"), Text("two"), Table(["h"], [["three"]]), Text("four")])
    words = ("Title", "lead", "one", "two", "h", "three", "four", f"catenary {__version__}")
    places = [text.index(f">{word}<") for word in words]
    assert places == sorted(places)


@pytest.mark.parametrize(
    "block",
    [Heading(NASTY), Text(NASTY), Table([NASTY], [[NASTY]]), Facts([(NASTY, NASTY)]), Remarks([NASTY]), Listing(NASTY, NASTY)],
    ids=lambda block: type(block).__name__,
)  # fmt: skip
def test_text_is_escaped(tmp_path: Path, block: Block) -> None:
    text = page(tmp_path / "p.html", [block])
    assert "<script>" not in text
    assert "&lt;script&gt;" in text
    assert "µ ±" in text


def test_pictures_are_inside_the_page(tmp_path: Path) -> None:
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    text = page(tmp_path / "p.html", [picture(figure, NASTY)])
    found = re.search(r'src="data:image/png;base64,([^"]+)"', text)
    assert found
    image = matplotlib.image.imread(io.BytesIO(base64.b64decode(found.group(1))))
    assert image.shape[:2] == (150, 300)  # 150 dots per inch


def test_simulated_data_are_marked_and_real_ones_are_not(tmp_path: Path) -> None:
    assert "Simulated: no real robot" in page(tmp_path / "p.html", [], simulated=True)
    real = page(tmp_path / "p.html", [Text("x")])
    # nothing outside either
    assert not re.search(r"Simulated|https?:|src=|href=|<script|@import|url\(", real)


def test_names_that_are_no_text_do_not_stop_the_page(tmp_path: Path) -> None:
    assert r"run\udcff" in page(tmp_path / "p.html", [Text("run\udcff")])


def test_a_page_that_cannot_be_written_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"p\.html: cannot be written"):
        page(tmp_path / "nowhere" / "p.html", [])


def test_settings_are_shown_without_brackets_digits_of_rounding_and_what_is_not_set() -> None:
    settings = {"base_tilt_deg": (0.0, -20.0), "seed": None, "names": ["pd", "sg"], "third": 1 / 3}
    facts = settings_facts(settings)
    assert facts.rows == [("base tilt deg", "0, -20"), ("names", "pd, sg"), ("third", "0.333333")]
