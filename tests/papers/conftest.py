import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Written = Callable[[Path, str], tuple[Any, str]]


@pytest.fixture(scope="session")
def written() -> Written:
    """Read the data and the page that a simulated experiment of a name has written to a folder."""

    def read(folder: Path, name: str) -> tuple[Any, str]:
        content = json.loads((folder / f"{name}.json").read_text())
        assert content["simulated"] is True
        return content["results"], (folder / f"{name}.html").read_text()

    return read
