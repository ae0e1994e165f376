import ast
from pathlib import Path
from runpy import run_path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


def test_there_are_examples() -> None:
    assert [path.name[:3] for path in EXAMPLES] == [f"{k:02d}_" for k in range(1, 12)]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_short_runs_and_says_what_one_sees(path, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("MPLBACKEND", "agg")
    run_path(str(path), run_name="__main__")
    shown = capsys.readouterr()
    assert shown.out
    assert not shown.err
    text = path.read_text()
    assert text.count("\n") < 60
    assert ast.get_docstring(ast.parse(text))
