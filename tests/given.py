"""Files that pages take as given, put into the folder in which a page is run: what a reader brings of his own."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest


def give(names: Sequence[str], folder: Path, request: pytest.FixtureRequest) -> None:
    """Put files that a page names into its folder."""
    for name in names:
        assert name in GIVEN, f"{name}: not among {', '.join(GIVEN)} of tests/given.py"
        GIVEN[name](folder / name, request)


def _model(path: Path, request: pytest.FixtureRequest) -> None:
    project = request.getfixturevalue("finished").page.parent
    for file in (project / "models").glob("recommended*"):
        shutil.copy(file, path.with_name(file.name.replace("recommended", path.stem)))


def _recording(part: str) -> Callable[[Path, pytest.FixtureRequest], None]:
    def put(path: Path, request: pytest.FixtureRequest) -> None:
        shutil.copy(request.getfixturevalue("finished").page.parent / f"{part}.parquet", path)

    return put


def _two_topics(path: Path, _: pytest.FixtureRequest) -> None:
    from lab_bags import two_topics

    two_topics(path, "ros1")


GIVEN: dict[str, Callable[[Path, pytest.FixtureRequest], None]] = {
    "arm.npz": _model,
    "monday.parquet": _recording("train"),
    "tuesday.parquet": _recording("test"),
    "lab.bag": _two_topics,
}
