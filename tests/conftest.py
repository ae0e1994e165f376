import pytest

from oracles.random_trees import RandomRobot, random_robot


@pytest.fixture(scope="session")
def random_robots() -> list[RandomRobot]:
    """Sixty trees: each size from one to nine joints six times and more."""
    return [random_robot(seed) for seed in range(60)]
