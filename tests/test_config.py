import datetime
from pathlib import Path

import pytest

from catenary.config import Settings, load_toml, parse_settings
from catenary.errors import ConfigError, FileFormatError


class Row(Settings):
    name: str
    a_m: float
    limits_deg: tuple[float, float] | None = None
    limits_m: tuple[float, float] | None = None


class Example(Settings):
    title: str = "x"
    count: int = 0
    on: bool = False
    folder: Path = Path(".")
    day: datetime.date | None = None
    row: list[Row] = []  # noqa: RUF012  # pydantic copies it


def test_a_file_becomes_its_schema(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(
        'title = "t"\nday = 2024-05-06\nfolder = "data"\n[[row]]\nname = "r"\na_m = 1\nlimits_deg = [0, 1.5]\n'
    )
    settings = load_toml(path, Example)
    assert settings.row[0].a_m == 1.0
    assert settings.row[0].limits_deg == (0.0, 1.5)
    assert settings.day == datetime.date(2024, 5, 6)
    assert settings.folder == Path("data")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("title = 3", "title: .*string.*got 3"),
        ('count = "3"', "count: .*integer.*got '3'"),
        ("count = 1.5", "count: .*got 1.5"),
        ("on = 1", "on: .*boolean"),
        ('[[row]]\nname = "r"\na_m = "1"', r'row\[0\] "r": a_m: .*number'),
        ('[[row]]\nname = "r"\na_m = true', r'row\[0\] "r": a_m: .*number'),
        ('[[row]]\nname = "r"\na_m = nan', r'row\[0\] "r": a_m: .*finite'),
        ('[[row]]\nname = "r"\na_m = inf', r'row\[0\] "r": a_m: .*finite'),
        ('[[row]]\nname = "r"', r'row\[0\] "r": a_m: this key is missing'),
        ("[[row]]\na_m = 1", r"row\[0\]: name: this key is missing"),
        ('[[row]]\nname = "r"\na_m = 1\na = 2', r'row\[0\] "r": a: unknown key.*ends in its unit: a_m'),
        ('[[row]]\nname = "r"\na_m = 1\nlimits = [0, 1]', "limits: unknown key.*limits_deg or limits_m"),
        ('[[row]]\nname = "r"\na_m = 1\nlimits_rad = [0, 1]', 'limits_rad: unknown key; did you mean "limits_'),
        ('titel = "t"', r'titel: unknown key; did you mean "title"\? \(known: count, day, folder, on, row, title\)'),
        ("zzz = 1", r"zzz: unknown key \(known"),
        ("title = ", "cannot be read as TOML"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_by_file_and_key(tmp_path, text, said):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=said) as caught:
        load_toml(path, Example)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.toml: no such file"):
        load_toml(tmp_path / "none.toml", Example)


def test_every_complaint_stands_on_its_own_line():
    with pytest.raises(ConfigError) as caught:
        parse_settings({"title": 1, "count": "x"}, Example, "here")
    assert [line.split(":")[0] for line in str(caught.value).splitlines()] == ["here", "here"]
    assert isinstance(caught.value, FileFormatError)


def test_settings_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        Example().title = "other"
