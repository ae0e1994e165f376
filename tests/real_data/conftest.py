import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real measurements: CATENARY_DATA, or ../shared/data beside the repository."""
    named = os.environ.get("CATENARY_DATA")
    folder = Path(named) if named else Path(__file__).parents[3] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real measurements in {folder}; CATENARY_DATA names their folder")
    return folder
