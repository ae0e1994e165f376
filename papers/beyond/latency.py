"""How long each method takes for one correction, as it would be asked in a servo loop: one row, one processor.

Ours run compiled, as `Corrector` ticks in a loop. The filter runs compiled over rows of 1 ms, and its links' dynamics
with it. The recurrent network is plain NumPy, the process and the forest are scikit-learn's, and a large part of their
time is the price of calls from Python; compiled they would take less. Times depend on the machine.
"""

import time
from collections.abc import Callable, Mapping

import numpy as np

from catenary import Corrector, random_sinusoids, record_simulated
from catenary.calibration.features import signals_of
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.plant import MotionLog
from papers.calibration.inputs import SIXTEEN
from papers.calibration.peer_hours import PROCESS, RECURRENT, SPACING, TWO_PHASE, UKF, UKF_TOLD, at_rows
from papers.calibration.peers.elastic_joints import identified
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.recurrent import PREVIOUS, fit_recurrent
from papers.calibration.peers.rows import rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase
from papers.calibration.peers.unscented import Filter
from papers.calibration.recordings import METHODS, calibration_log, draws, fitted, homed
from papers.calibration.six_hours import OFFSET
from papers.experiment import Result, run

ROUNDS, SHORTEST = 9, 0.02  # and the least time of a round [s]


@run(revision=1)
def latencies(sparsity: float, seconds: float, every: int) -> Result:
    """Fit every method to one zig-zag of the nominal robot and time it; return the median [us] of a correction.

    What it was fitted to hardly matters: the cost is that of the sizes, which are those of table III.

    Args:
        sparsity: Of the zig-zag.
        seconds: Of the motion at 1 kHz that the filter runs over.
        every: Rows from one that is learned from to the next.
    """
    plant = homed(None)
    log = calibration_log(plant, draws(None, 90), sparsities=(sparsity,))
    rng = draws(None, 91)
    motion = record_simulated(plant, random_sinusoids(rng, seconds), "random", rng, state_rate=1000.0)
    learned, last = at_rows(log, np.arange(0, len(log), every)), len(log) - 1
    rows = rows_of_log(learned, SIXTEEN)
    one = rows_of_log(at_rows(log, np.array([last])), SIXTEEN)
    few = rows_of_log(at_rows(log, np.arange(last - PREVIOUS * SPACING, last + 1)), SIXTEEN)
    recurrent = fit_recurrent(rows, seed=0, spacing=SPACING, iterations=1)
    process, two_phase = fit_gaussian_process(rows, seed=0, chosen=50), fit_two_phase(rows, seed=0)
    kalman, end = Filter(identified([log])), np.array([len(few.inputs) - 1])
    calls: dict[str, Callable[[], object]] = {
        RECURRENT: lambda: recurrent.correction(few, end),
        PROCESS: lambda: process.correction(one),
        TWO_PHASE: lambda: two_phase.correction(one),
    }
    options: Mapping[str, FitOptions] = {OFFSET: FitOptions(kind="offset", inputs=SIXTEEN), **METHODS}
    for name, each in options.items():
        calls[name] = _tick(fitted([learned], each), log)
    found = {name: _microseconds(call) for name, call in calls.items()}
    found[UKF] = found[UKF_TOLD] = _microseconds(lambda: kalman.correction(motion)) / len(motion)
    return {name: round(value, 3) for name, value in found.items()}


def _tick(model: CalibrationModel, log: MotionLog) -> Callable[[], None]:
    """Return one tick of a model in a loop, on the last row of a recording."""
    known = signals_of(log)
    signals = np.array([known[name][0][-1] for name in model.features.signals])
    n = len(model.joint_names)
    return Corrector(model, rate_hz=1000.0).bind(
        log.q_nominal[-1].copy(), signals, np.zeros(n), np.zeros(n, dtype=bool)
    )


def _microseconds(call: Callable[[], object]) -> float:
    """Return the median over rounds of the processor time of a call [us]."""
    call()  # whatever is compiled or loaded at first
    begin = time.perf_counter()
    call()
    count = max(1, int(SHORTEST / max(1e-7, time.perf_counter() - begin)))
    taken = []
    for _ in range(ROUNDS):
        begin_ns = time.thread_time_ns()
        for _ in range(count):
            call()
        taken.append((time.thread_time_ns() - begin_ns) / count / 1000.0)
    return float(np.median(taken))
