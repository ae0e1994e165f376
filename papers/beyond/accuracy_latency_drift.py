"""Accuracy at once, accuracy after six hours, and the time of one correction, of every method in one picture.

The accuracy is that of table III: every method learns from the same 17 minutes of zig-zags of the same simulated robots
and is tested on the same six unloaded hours. The time is the processor's for one correction, as a servo loop at 1 kHz
would ask for it: it depends on how a method is written and on the machine, here two shared cores under load, half as
fast as idle ones. Ours run compiled, and the filter with its links' dynamics; the recurrent network is plain NumPy, the
process and the forest are scikit-learn's, and much of their time is the price of calls from Python.
"""

import time
import timeit
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from catenary import Corrector, random_sinusoids, record_simulated
from catenary.arrays import Floats
from catenary.calibration.features import signals_of
from catenary.calibration.model import CalibrationModel
from catenary.plant import MotionLog
from papers.calibration import tables_3_and_4
from papers.calibration.inputs import SIXTEEN
from papers.calibration.peer_hours import PEERS, PROCESS, RECURRENT, SPACING, TWO_PHASE, UKF, UKF_TOLD
from papers.calibration.peers.elastic_joints import Filter, identified
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.recurrent import PREVIOUS, fit_recurrent
from papers.calibration.peers.rows import rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase
from papers.calibration.published import TABLE_3_OURS
from papers.calibration.recordings import LEARNER, NETWORK, at_rows, calibration_log, draws, fitted, homed
from papers.calibration.six_hours import OFFSET, fit_options
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, panels
from papers.kit import IN_UNITS, JOINTS, UNITS, cells, rows, table

ROUNDS, SHORTEST = 9, 0.02  # and the least time of a round [s]
TIMED = (OFFSET, "linear", "polynomial", NETWORK, LEARNER, *PEERS)
SERVO = 1000.0  # [us] of a loop's period
PUBLISHED = {NETWORK: 61e3, "linear": 380.0}  # [us] of an inference, table V


@run(revision=3)
def latencies(sparsity: float, seconds: float, every: int) -> Result:
    """Fit every method to one zig-zag of the nominal robot and time it; return the least time [us] of a correction.

    What it was fitted to hardly matters: the cost is that of the sizes, which are those of table III.
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
    for name in (OFFSET, "linear", "polynomial", NETWORK, LEARNER):
        calls[name] = _tick(fitted([learned], fit_options(name, "error")), log)
    durations = {name: _microseconds(call) for name, call in calls.items()}
    durations[UKF] = durations[UKF_TOLD] = _microseconds(lambda: kalman.correction(motion)) / len(motion)
    return {name: round(value, 3) for name, value in durations.items()}


def _tick(model: CalibrationModel, log: MotionLog) -> Callable[[], None]:
    """Return one tick of a model in a loop, on the last row of a recording."""
    known = signals_of(log)
    signals = np.array([known[name][0][-1] for name in model.features.signals])
    n = len(model.joint_names)
    return Corrector(model, rate_hz=1000.0).bind(
        log.q_nominal[-1].copy(), signals, np.zeros(n), np.zeros(n, dtype=bool)
    )


def _microseconds(call: Callable[[], object]) -> float:
    """Return the least processor time of a call over rounds [us]: a busy machine only adds to it."""
    call()  # whatever is compiled or loaded at first
    count = max(1, int(SHORTEST / max(1e-7, timeit.timeit(call, number=1))))
    return 1e6 * min(timeit.repeat(call, timer=time.thread_time, number=count, repeat=ROUNDS)) / count


def cases(scope: Scope) -> list[Case]:
    """Return table III's cases, and one that times every method."""
    timed = latencies.case(sparsity=1 / 2, seconds=4.0, every=20 if scope.quick else 1)
    return [*tables_3_and_4.cases(scope), timed]


def microseconds(o: Outcomes) -> dict[str, float]:
    """Return how long one correction of each method takes [us]."""
    return {name: value for result in o.of(latencies) for name, value in result.items()}


def present(o: Outcomes) -> list[str]:
    """Return the methods that have errors and times."""
    timed = microseconds(o)
    return [name for name in TIMED if name in timed and tables_3_and_4.hours(o, name).size]


def left(o: Outcomes, method: str) -> Floats:
    """Return errors in hours 0 and 5 over the same robots' fixed offset's in hour 0 [%], geometric mean, (2,)."""
    errors = tables_3_and_4.hours(o, method)
    ends, offset = errors.mean(axis=0)[[0, -1]], tables_3_and_4.hours(o, OFFSET)[: len(errors), 0].mean(axis=0)
    shares: Floats = 100.0 * np.exp(np.mean(np.log(ends / offset), axis=1))
    return shares


def report(o: Outcomes) -> Report:
    """Return the table, the picture, and the sentence."""
    timed = microseconds(o)

    def row(name: str) -> list[str]:
        errors, share = tables_3_and_4.hours(o, name), left(o, name)
        lost = cells(errors[:, -1] - errors[:, 0])
        return [name, *cells(errors[:, 0]), *lost, f"{share[0]:.0f}, {share[1]:.0f}", f"{timed[name]:.1f}"]

    lost = [f"{joint} lost [{unit}]" for joint, unit in zip(JOINTS, UNITS, strict=True)]
    header = ["method", *IN_UNITS, *lost, "hours 0, 5 [% of offset]", "time [us]"]
    title = "RMSE in hour 0, what is lost until hour 5, both as a share of the fixed offset's in hour 0; one correction"
    caption = (
        "RMSE over the time of one correction: from hour 0 (dot) to hour 5 (arrow), mean over robots; dashed: a loop "
        "at 1 kHz; squares: the paper's network and linear model"
    )
    names = present(o)
    if not names:
        return Report()
    remark = sentence({name: (*left(o, name), timed[name]) for name in names})
    return Report([table(title, header, rows(row, names))], {caption: _picture(o)}, [remark])


def sentence(by_method: dict[str, Sequence[float]]) -> str:
    """Return what the numbers say in a sentence: by method, what is left in hours 0 and 5 [%] and the time [us]."""
    learned = {name: values for name, values in by_method.items() if name != OFFSET}
    first, last = (min(learned, key=lambda name, k=k: learned[name][k]) for k in (0, 1))  # type: ignore[misc]
    lost = [values[1] - values[0] for values in learned.values()]
    fast = [name for name, values in learned.items() if values[2] < SERVO]
    apart = [learned["linear"][k] - learned[best][k] for k, best in enumerate((first, last))]
    return (
        f"Right after calibration the {first} is best, with {learned[first][0]:.0f} % of the fixed offset's error left "
        f"and {learned[first][2]:.1f} us a correction; six hours later the {last}, with {learned[last][1]:.0f} % and "
        f"{learned[last][2]:.1f} us. The hours cost the methods {min(lost):.0f} to {max(lost):.0f} points; the linear "
        f"model lies {apart[0]:.0f} points behind the best at once and {apart[1]:.0f} after them. {len(fast)} of "
        f"{len(learned)} fit into a servo loop at 1 kHz."
    )


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 4.0)
    timed = microseconds(o)
    for j, panel in enumerate(axes):
        for name in present(o):
            mean = tables_3_and_4.hours(o, name).mean(axis=0)[[0, -1], j]
            color = tables_3_and_4.COLORS[name]
            panel.plot(timed[name], mean[0], "o", color=color, ms=5, label=name)
            arrow = {"arrowstyle": "->", "color": color, "lw": 1.5}
            panel.annotate("", (timed[name], mean[1]), (timed[name], mean[0]), arrowprops=arrow)
        for name, took in PUBLISHED.items():
            (low, high), color = TABLE_3_OURS[name][j], tables_3_and_4.COLORS[name]
            panel.plot(took, low, "s", mfc="none", color=color, ms=5)
            panel.annotate("", (took, high), (took, low), arrowprops={"arrowstyle": "->", "color": color})
        panel.axvline(SERVO, color="#8a94a3", ls="--", lw=0.8)
        panel.set_xscale("log")
        ends = [tables_3_and_4.hours(o, name).mean(axis=0)[:, j].max() for name in present(o)]
        panel.set_ylim(0.0, 1.08 * max(ends))
        panel.set_xlabel("one correction [us]")
        panel.set_title(f"{IN_UNITS[j]}", fontsize=10)
    legend_below(figure, axes[0], columns=5)
    return figure


# beside table III's cases
EXPERIMENT = Experiment(
    "beyond-accuracy-latency-drift", "beyond tables III and V", "Accuracy, latency and drift of every method", __doc__,
    cases, report, minutes=2.0,
)  # fmt: skip
