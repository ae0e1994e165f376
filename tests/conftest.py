from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numba
import pytest

if TYPE_CHECKING:  # nothing of catenary may be imported before pytest_configure has run
    from oracles.random_trees import RandomRobot

ROOT = Path(__file__).parents[1]


def pytest_configure() -> None:
    """Keep compiled code per state of the sources.

    numba recompiles a function when its own file changes, not when a file it calls into does, so tests would
    run what a recursion was before it was edited.
    """
    sources = sha256()
    for path in sorted((ROOT / "src").rglob("*.py")):
        sources.update(path.read_bytes())
    numba.config.CACHE_DIR = str(ROOT / ".cache" / "numba" / sources.hexdigest()[:16])


@pytest.fixture(scope="session")
def random_robots() -> "list[RandomRobot]":
    """Sixty trees: each size from one to nine joints six times and more."""
    from oracles.random_trees import random_robot

    return [random_robot(seed) for seed in range(60)]
