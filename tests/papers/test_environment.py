"""Results on another processor: the same cases with the BLAS kernels of an older one, in a process of its own."""

import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from papers import environment
from papers.beyond import tilted_calibration
from papers.environment import NEGLIGIBLE, TOLERANCE, TOLERANCE_OF_NETWORKS
from papers.experiment import Scope
from papers.regressor.decomposition import decomposition
from papers.runner import execute, fingerprint
from papers.tutorial.two_link import errors_of

ROOT = Path(__file__).parents[2]
QUICK = Scope((None,), networks=1, quick=True)
# a second each: a regressor's decomposition, an arm under control, and a cable robot's calibration
CASES = [
    decomposition.case(robot="raven2"),
    errors_of.case(controller="PD, inertia, gravity", speed=1.0),
    *tilted_calibration.cases_of(None, tilted_calibration.LEVEL, tilted_calibration.PAPERS, QUICK, ("level",)),
]
ELSEWHERE = """
import json
from papers.environment import processor
from papers.runner import execute, fingerprint
from test_environment import CASES
results = [execute(case, None, fingerprint()).result for case in CASES]
print(json.dumps([processor(), results]))
"""


def numbers(result: Any) -> Iterator[float]:
    """Yield a result's numbers in their order."""
    if isinstance(result, dict):
        result = list(result.values())
    if isinstance(result, list | tuple):
        for each in result:
            yield from numbers(each)
    elif isinstance(result, float | int):
        yield float(result)


def test_the_page_states_the_tolerances_that_are_held() -> None:
    page = (ROOT / "docs" / "papers.md").read_text()
    for held in (TOLERANCE, TOLERANCE_OF_NETWORKS):
        assert f"1e-{round(-math.log10(held))} of " in page


@pytest.mark.slow
@pytest.mark.skipif(
    "BLAS for any" in environment.processor() or platform.machine() != "x86_64", reason="no BLAS of several processors"
)
def test_another_processors_blas_changes_results_within_the_tolerance_that_is_stated() -> None:
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    there = subprocess.run(
        [sys.executable, "-c", ELSEWHERE],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_CORETYPE": "Sandybridge"},
        capture_output=True,
        text=True,
        check=True,
    )
    other, results = json.loads(there.stdout.splitlines()[-1])
    assert other.endswith("BLAS for Sandybridge")
    for case, result in zip(CASES, results, strict=True):
        here = execute(case, None, fingerprint()).result
        np.testing.assert_allclose(
            list(numbers(result)), list(numbers(here)), rtol=TOLERANCE, atol=NEGLIGIBLE, err_msg=case.label
        )
