import logging
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def _log_level() -> Iterator[None]:
    """Put the level of the log back, which programs here change."""
    log = logging.getLogger("catenary")
    before = log.level
    yield
    log.setLevel(before)
