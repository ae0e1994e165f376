"""From a recording to filtered positions, velocities, accelerations and torques."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.actuation import known_torque
from catenary.errors import InputError
from catenary.identification.log_checks import check_log, check_rates
from catenary.identification.options import IdentifyOptions, actuation_of, filter_of
from catenary.plant import MotionLog
from catenary.robots.actuation import SignalFilter
from catenary.robots.model import RobotModel

IRREGULAR = 0.01  # relative spread of time steps beyond which a recording is brought to even steps


@dataclass(frozen=True)
class Samples:
    """Rows of one recording, (N, n) in rad, m, s, Nm, N; `tau` is less what is known beforehand."""

    name: str
    q: Floats
    qd: Floats
    qdd: Floats
    tau: Floats
    known: Floats  # (N, n) what was subtracted from the measured torque
    time: Floats  # (N,) [s]; row numbers of a recording at rest
    independent: float  # share of the rows that count as independent: a filter ties neighbours together

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, which: NDArray[np.bool_], name: str) -> "Samples":
        """Return some of the rows under another name."""
        chosen: dict[str, Floats] = {
            key: getattr(self, key)[which] for key in ("q", "qd", "qdd", "tau", "known", "time")
        }
        return replace(self, name=name, **chosen)  # type: ignore[arg-type]  # none of them is the share


def prepare(log: MotionLog, model: RobotModel, options: IdentifyOptions) -> Samples:
    """Filter a recording, derive accelerations, cut both ends, and subtract known torques.

    Zero-phase Butterworth on positions, velocities and torques; accelerations are central differences of the
    filtered velocity, and so are velocities of the position where none were recorded. A recording in which time goes
    back is several, each filtered by itself. At rest nothing is filtered.

    Raises:
        InputError: Other joints than the robot's, no torques, no time, not rad, m and s by the look of it, or shorter
            than the filter needs; the message names the recording and the joint.
    """
    check_log(log, model)
    assert log.tau is not None  # for the type checker; check_log refused
    actuation = actuation_of(model)
    if options.terms == "static":
        zero = np.zeros(log.q_nominal.shape)
        known = known_torque(actuation, log.q_nominal)
        rows = np.arange(len(log), dtype=float)
        return Samples(log.name, log.q_nominal, zero, zero, log.tau - known, known, rows, 1.0)
    if log.time is None:
        raise InputError(
            f'recording "{log.name}": has no time: full dynamics need `fs` [Hz] or `t` [s]; '
            "poses at rest need neither (terms static)"
        )
    settings = filter_of(model, options)
    bounds = [*log.starts, len(log)]
    parts = [_segment(log, slice(first, last), model, settings) for first, last in pairwise(bounds)]
    q, qd, qdd, tau, time = (np.concatenate([part[k] for part in parts]) for k in range(5))
    known = known_torque(actuation, q)
    rate = 1.0 / float(np.median(np.diff(time)))
    independent = min(1.0, 2.0 * settings.cutoff_hz / rate)
    return Samples(log.name, q, qd, qdd, tau - known, known, time, independent)


def _segment(
    log: MotionLog, part: slice, model: RobotModel, settings: SignalFilter
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    where = f'recording "{log.name}"'
    assert log.time is not None
    assert log.tau is not None
    time = log.time[part]
    least = 2 * settings.cut_samples + 3 * (2 * settings.order + 1) + 2
    if len(time) < least:
        raise InputError(
            f"{where}: {len(time)} rows from row {part.start}: shorter than the filter, which needs {least} "
            f"(order {settings.order}, {settings.cut_samples} samples cut at each end)"
        )
    signals = [log.q_nominal[part], log.tau[part], *([] if log.qd is None else [log.qd[part]])]
    steps = np.diff(time)
    step = float(np.median(steps)) if settings.rate_hz is None else 1.0 / settings.rate_hz
    if not step > 0.0:
        raise InputError(f"{where}: time stands still on most rows")
    if np.ptp(steps) > IRREGULAR * step or abs(float(np.median(steps)) / step - 1.0) > IRREGULAR:
        increasing = np.concatenate([[True], steps > 0.0])  # a repeated stamp has nothing to add
        even = np.arange(time[0], time[-1], step)
        signals = [
            np.column_stack([np.interp(even, time[increasing], column[increasing]) for column in values.T])
            for values in signals
        ]
        time = even
        if len(time) < least:
            raise InputError(
                f"{where}: {len(time)} rows at {1 / step:g} Hz: shorter than the filter's {least}"
            )
    nyquist = 0.5 / step
    if settings.cutoff_hz >= nyquist:
        raise InputError(
            f"{where}: recorded at {1.0 / step:g} Hz: the cut-off {settings.cutoff_hz:g} Hz must be below half of it"
        )
    from scipy.signal import butter, sosfiltfilt

    sections = butter(settings.order, settings.cutoff_hz / nyquist, output="sos")
    q, tau, *velocity = (np.asarray(sosfiltfilt(sections, values, axis=0)) for values in signals)
    derivative = np.gradient(q, step, axis=0)
    qd = velocity[0] if velocity else derivative
    qdd = np.gradient(qd, step, axis=0)
    inner = slice(settings.cut_samples, len(time) - settings.cut_samples)
    if velocity:
        check_rates(where, model, derivative[inner], qd[inner])
    return q[inner], qd[inner], qdd[inner], tau[inner], time[inner]


def alternate_blocks(samples: Samples, length: float) -> tuple[Samples, Samples]:
    """Split a recording into every first and every second block of a length [s, or rows at rest].

    Raises:
        InputError: It has not two blocks.
    """
    held_out = np.floor((samples.time - samples.time[0]) / length).astype(np.int64) % 2 == 1
    if not held_out.any():
        raise InputError(
            f'recording "{samples.name}": spans {samples.time[-1] - samples.time[0]:.4g}, less than two blocks '
            f"of {length:g}"
        )
    return samples.rows(~held_out, samples.name), samples.rows(held_out, f"{samples.name} (held-out blocks)")
