"""How long the paper's network and linear model take to train and to answer, on whichever processor runs this."""

import platform
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor

from catenary.calibration.corrector import Corrector
from papers.calibration.recordings import METHODS, NETWORK, calibration_log, draws, fitted, homed, rows_of
from papers.experiment import NOMINAL, Result, run

KINDS = (NETWORK, "linear")
HIDDEN = (100, 100)  # units of the paper's network


@run(revision=1)
def speed(sparsities: Sequence[float], trainings: int, calls: int) -> Result:
    """Time network and linear model, trained on the nominal robot's zig-zags.

    Args:
        sparsities: Of the zig-zags.
        trainings: How often each is trained.
        calls: How often each answers, one row a call.

    Returns:
        `processor`; `recorded` [s] and `rows` of the training set; and by model, medians: `train` [s]; `deployed`, a
        tick of the compiled model as a robot runs it, and `framework`, a call of scikit-learn's predict with a model
        of the same size, both [us] for one row.
    """
    log = calibration_log(homed(NOMINAL), draws(NOMINAL, 80), sparsities=sparsities)
    stamps = np.asarray(log.time)
    found: dict[str, Any] = {"train": {}, "deployed": {}, "framework": {}}
    for kind in KINDS:
        seconds = []
        for _ in range(trainings):
            begin = time.perf_counter()
            model = fitted([log], METHODS[kind])
            seconds.append(time.perf_counter() - begin)
        data = rows_of(model, log)
        tick = Corrector(model).bind(data.q_nominal[0].copy(), data.X[0].copy(), np.zeros(3), np.zeros(3, dtype=bool))
        answer = partial(framework_model(kind, data.X, data.error).predict, data.X[:1].copy())
        found["train"][kind] = float(np.median(seconds))
        found["deployed"][kind] = 1e6 * _median(tick, calls)
        found["framework"][kind] = 1e6 * _median(answer, calls)
    return {"processor": processor(), "recorded": float(stamps[-1] - stamps[0]), "rows": len(log), **found}


def framework_model(kind: str, X: Any, Y: Any) -> Any:
    """Return scikit-learn's model of the paper's size; the network hardly trained: its time is that of its size."""
    if kind == "linear":
        return LinearRegression().fit(X, Y)
    network = MLPRegressor(hidden_layer_sizes=HIDDEN, activation="logistic", random_state=0)
    return network.partial_fit(X[:100], Y[:100])


def processor() -> str:
    """Return the name of this machine's processor."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _median(call: Callable[[], object], times: int) -> float:
    call()  # compiled, and warm
    seconds = []
    for _ in range(times):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return float(np.median(seconds))
