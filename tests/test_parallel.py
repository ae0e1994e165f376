"""Independent parts of a task side by side: the same results in the same order, on processes and on a Dask cluster."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.errors import InputError
from catenary.parallel import Progress, of_each, on_workers
from tests.hysteretic_arm import recording

RUN = FitRun(folds=2)


def squared(number: int, tell: Progress) -> int:
    tell(1.0)
    if number < 0:
        raise InputError(f"number: expected zero or more, got {number}")
    return number * number


def fitted() -> FitResult:
    logs = [recording(seed, rows=400) for seed in (0, 1)]
    return fit_logs(logs, FitOptions(kind="neural", preset="paper", coupled=()), RUN)


@pytest.fixture(scope="module")
def alone() -> FitResult:
    return fitted()


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    # its workers are threads of this process, met over TCP as others are: to start processes takes seconds
    options = {"processes": False, "protocol": "tcp://", "dashboard_address": "127.0.0.1:0", "memory_limit": 0}
    with LocalCluster(n_workers=2, threads_per_worker=1, **options) as local:
        yield local


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order_and_progress_goes_to_its_end(workers: int) -> None:
    told: list[float] = []
    with on_workers(workers):
        assert of_each(squared, range(5), progress=told.append) == [0, 1, 4, 9, 16]
    assert told == sorted(told)
    assert told[-1] == 1.0


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_of_one_part_is_the_error_of_all(workers: int) -> None:
    with on_workers(workers), pytest.raises(InputError, match="zero or more, got -1"):
        of_each(squared, [1, -1, 2])


@pytest.mark.parametrize("where", ["processes", "cluster"])
def test_a_fit_side_by_side_gives_the_same_bits(where: str, alone: FitResult, request: pytest.FixtureRequest) -> None:
    if where == "processes":
        with on_workers(2):
            found = fitted()
    else:
        with on_workers(cluster=request.getfixturevalue("cluster").scheduler_address):
            found = fitted()
    assert found.card["errors"] == alone.card["errors"]
    for one, other in zip(found.model.groups, alone.model.groups, strict=True):
        X = np.random.default_rng(0).normal(size=(50, len(one.columns)))
        np.testing.assert_array_equal(one.predictor.predict(X), other.predictor.predict(X))


def test_a_cluster_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.parallel._CLUSTER_TIMEOUT", "1 s")
    with pytest.raises(InputError, match="no scheduler answers"), on_workers(1, "tcp://127.0.0.1:9"):
        pass
