"""From a recording to filtered positions, velocities, accelerations and torques."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.actuation import known_torque
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.errors import InputError
from catenary.identification.base_signals import base_of, smoothed_base
from catenary.identification.course import Course
from catenary.identification.log_checks import check_rates, checked_log
from catenary.identification.options import IdentifyOptions, actuation_of, filter_of
from catenary.plant import MotionLog
from catenary.robots.actuation import SignalFilter
from catenary.robots.model import RobotModel

EVERY = slice(None)
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
    gravity: Floats | None = None  # (N, 3) [m/s2] in base axes, where the recording holds it
    base: Floats | None = (
        None  # (N, 2, 3) angular velocity and acceleration of the base [rad/s, rad/s2], likewise
    )
    course: Course | None = None  # of the motion that friction remembers; none at rest
    carried: Floats | None = None  # (N, n) what the links ask, that load-dependent friction grows with

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, which: NDArray[np.bool_], name: str) -> "Samples":
        """Return some of the rows under another name."""
        keys = ("q", "qd", "qdd", "tau", "known", "time", "gravity", "base", "carried")
        chosen: dict[str, Any] = {
            key: values[which] for key in keys if (values := getattr(self, key)) is not None
        }
        if self.course is not None:
            chosen["course"] = self.course.rows(which)
        return replace(self, name=name, **chosen)

    def gravity_rows(self, otherwise: Floats, part: slice = EVERY) -> Floats:
        """Return gravity on some rows (N, 3), or one (3,) for all where the recording holds none."""
        return otherwise if self.gravity is None else self.gravity[part]

    def base_motion(self, part: slice = EVERY) -> BaseMotion | None:
        """Return how the base turned on some rows; None where it did not, or the recording does not say."""
        if self.base is None:
            return None
        return BaseMotion(self.base[part, 0], self.base[part, 1])


def prepare(log: MotionLog, model: RobotModel, options: IdentifyOptions) -> Samples:
    """Filter a recording, derive accelerations, cut both ends, and subtract known torques.

    Zero-phase Butterworth on positions, velocities and torques; accelerations are central differences of the
    filtered velocity, and so are velocities of the position where none were recorded. A recording in which time goes
    back is several, each filtered by itself. At rest nothing is filtered.

    Raises:
        InputError: Other joints than the robot's, no torques, no time, not rad, m and s by the look of it, or shorter
            than the filter needs; the message names the recording and the joint.
    """
    log = checked_log(log, model)
    assert log.tau is not None  # for the type checker; checked_log refused
    actuation = actuation_of(model)
    if options.terms == "static":
        zero = np.zeros(log.q_nominal.shape)
        known = known_torque(actuation, log.q_nominal)
        rows = np.arange(len(log), dtype=float)
        gravity, _, _ = base_of(log)
        return Samples(
            log.name, log.q_nominal, zero, zero, log.tau - known, known, rows, 1.0, gravity=gravity
        )
    if log.time is None:
        raise InputError(
            f'recording "{log.name}": has no time: full dynamics need `fs` [Hz] or `t` [s]; '
            "poses at rest need neither (terms static)"
        )
    settings = filter_of(model, options)
    bounds = [*log.starts, len(log)]
    parts = [_segment(log, slice(first, last), model, settings) for first, last in pairwise(bounds)]
    cut = settings.cut_samples
    q, qd, qdd, tau, time = (
        np.concatenate([values[cut : len(values) - cut] for values in of])
        for of in zip(*(part[:5] for part in parts), strict=True)
    )
    gravity, base = (
        None if of[0] is None else np.concatenate([values[cut : len(values) - cut] for values in of])
        for of in zip(*((part.gravity, part.base) for part in parts), strict=True)
    )
    known = known_torque(actuation, q)
    rate = 1.0 / float(np.median(np.diff(time)))
    course = Course(tuple((part.q, part.qd) for part in parts), cut, parts[0].sections, np.arange(len(q)))
    independent = min(1.0, 2.0 * settings.cutoff_hz / rate)
    return Samples(
        log.name, q, qd, qdd, tau - known, known, time, independent, gravity=gravity, base=base, course=course
    )


class _Segment(NamedTuple):
    """A stretch of a recording, filtered, not yet cut."""

    q: Floats
    qd: Floats
    qdd: Floats
    tau: Floats
    time: Floats
    gravity: Floats | None
    base: Floats | None
    sections: Floats


def _segment(log: MotionLog, part: slice, model: RobotModel, settings: SignalFilter) -> _Segment:
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
    sensed = [values for values in base_of(log) if values is not None]
    signals = [
        log.q_nominal[part],
        log.tau[part],
        *([] if log.qd is None else [log.qd[part]]),
        *(values[part] for values in sensed),
    ]
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
    q, tau, *rest = (np.asarray(sosfiltfilt(sections, values, axis=0)) for values in signals)
    derivative = np.gradient(q, step, axis=0)
    qd = derivative if log.qd is None else rest.pop(0)
    qdd = np.gradient(qd, step, axis=0)
    if log.qd is not None:
        inner = slice(settings.cut_samples, len(time) - settings.cut_samples)
        check_rates(where, model, derivative[inner], qd[inner])
    return _Segment(q, qd, qdd, tau, time, *smoothed_base(log, rest, step), sections)


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
