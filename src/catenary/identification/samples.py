"""From a recording to filtered positions, velocities, accelerations and torques."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import known_torque
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
BRIDGED = 1.0  # periods of the cut-off, over which a line is 5 % off for a motion of a tenth of its frequency
MADE, MOST_MADE = 1.1, 100  # even rows for each one recorded: from which on that is told, and refused


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
    notes: tuple[str, ...] = ()  # on gaps in time, and rows that were left out or made

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
    back, or that has gaps, is several, each filtered and cut by itself; those shorter than the filter
    needs are left out. At rest nothing is filtered.

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
    cut = settings.cut_samples
    least = 2 * cut + 3 * (2 * settings.order + 1) + 2
    stretches, gaps = _stretches(log, settings)
    grids = [(part, *_grid(f'recording "{log.name}"', log.time[part], settings)) for part in stretches]
    parts = [_segment(log, *grid, settings) for grid in grids if len(grid[1]) >= least]
    if not parts:
        longest, even, _ = max(grids, key=lambda grid: len(grid[1]))
        between = f", between {len(gaps)} gap(s) in time" if len(gaps) else ""
        raise InputError(
            f'recording "{log.name}": {len(even)} rows from row {longest.start}{between}: shorter than the filter, '
            f"which needs {least} (order {settings.order}, {cut} samples cut at each end)"
        )
    q, qd, qdd, tau, time, derivative = (
        np.concatenate([values[cut : len(values) - cut] for values in of])
        for of in zip(*(part[:6] for part in parts), strict=True)
    )
    if log.qd is not None:
        check_rates(f'recording "{log.name}"', model, derivative, qd)
    gravity, base = (
        None if of[0] is None else np.concatenate([values[cut : len(values) - cut] for values in of])
        for of in zip(*((part.gravity, part.base) for part in parts), strict=True)
    )
    known = known_torque(actuation, q)
    rate = 1.0 / float(np.median(np.diff(time)))
    course = Course(tuple((part.q, part.qd) for part in parts), cut, parts[0].sections, np.arange(len(q)))
    independent = min(1.0, 2.0 * settings.cutoff_hz / rate)
    return Samples(
        log.name, q, qd, qdd, tau - known, known, time, independent, gravity=gravity, base=base, course=course,
        notes=_told(log, len(stretches), parts, gaps, len(q)),
    )  # fmt: skip


def _stretches(log: MotionLog, settings: SignalFilter) -> tuple[list[slice], Floats]:
    """Return the stretches in which time goes on without a gap, and the lengths of the gaps [s]."""
    steps = np.diff(log.time) if log.time is not None else np.zeros(0)
    if not np.count_nonzero(steps) or (settings.rate_hz is None and float(np.median(steps)) <= 0.0):
        raise InputError(f'recording "{log.name}": time stands still on most rows')
    gaps = log.gaps(BRIDGED / settings.cutoff_hz)
    bounds = sorted({*log.starts, *gaps, len(log)})
    return [slice(first, last) for first, last in pairwise(bounds)], steps[np.array(gaps, dtype=int) - 1]


def _told(
    log: MotionLog, stretches: int, parts: "Sequence[_Segment]", gaps: Floats, kept: int
) -> tuple[str, ...]:
    """Return in words what became of the rows, where it is not the usual."""
    rows, made, short = sum(p.rows for p in parts), sum(len(p.q) for p in parts), stretches - len(parts)
    longest = f"{len(gaps)} gap(s) in time, the longest {gaps.max(initial=0.0):.3g} s"
    told = {
        f"{longest}: what lies between was filtered, and cut at both ends, by itself": len(gaps) > 0,
        f"{short} stretch(es) of time shorter than the filter needs, {len(log) - rows} rows, were left out": short,
        f"{rows} rows were brought to {made} even ones, on straight lines": made > MADE * rows,
    }
    return tuple(f"{note}; {kept} rows are used of {len(log)}" for note, is_so in told.items() if is_so)


class _Segment(NamedTuple):
    """A stretch of a recording, filtered, not yet cut."""

    q: Floats
    qd: Floats
    qdd: Floats
    tau: Floats
    time: Floats
    derivative: Floats  # of the positions
    gravity: Floats | None
    base: Floats | None
    sections: Floats
    rows: int  # as recorded


def _grid(where: str, time: Floats, settings: SignalFilter) -> tuple[Floats, float]:
    """Return even times for a stretch (M,), those that it has where these are even, and their step [s]."""
    steps = np.diff(time)
    if not len(steps):
        return time, 1.0
    usual = float(np.median(steps))
    # of bursts half the mean: no more than two rows are made of one
    step = max(usual, 0.5 * float(np.mean(steps))) if settings.rate_hz is None else 1.0 / settings.rate_hz
    if float(time[-1] - time[0]) > MOST_MADE * len(time) * step > 0.0:
        raise InputError(
            f"{where}: {len(time)} rows in {time[-1] - time[0]:g} s, filtered at {1 / step:g} Hz: expected {MOST_MADE} "
            "times as many rows at most; is time in ms, us or ns?"
        )
    if step > 0.0 and (np.ptp(steps) > IRREGULAR * step or abs(usual / step - 1.0) > IRREGULAR):
        return np.arange(time[0], time[-1], step), step
    return time, step


def _segment(log: MotionLog, part: slice, even: Floats, step: float, settings: SignalFilter) -> _Segment:
    assert log.time is not None
    assert log.tau is not None
    time = log.time[part]
    sensed = [values for values in base_of(log) if values is not None]
    signals = [
        log.q_nominal[part],
        log.tau[part],
        *([] if log.qd is None else [log.qd[part]]),
        *(values[part] for values in sensed),
    ]
    if not np.array_equal(even, time):
        increasing = np.concatenate([[True], np.diff(time) > 0.0])  # a repeated stamp has nothing to add
        signals = [
            np.column_stack([np.interp(even, time[increasing], column[increasing]) for column in values.T])
            for values in signals
        ]
    nyquist = 0.5 / step
    if settings.cutoff_hz >= nyquist:
        raise InputError(
            f'recording "{log.name}": recorded at {1.0 / step:g} Hz: the cut-off {settings.cutoff_hz:g} Hz must be '
            "below half of it"
        )
    from scipy.signal import butter, sosfiltfilt

    sections = butter(settings.order, settings.cutoff_hz / nyquist, output="sos")
    q, tau, *rest = (np.asarray(sosfiltfilt(sections, values, axis=0)) for values in signals)
    derivative = np.gradient(q, step, axis=0)
    qd = derivative if log.qd is None else rest.pop(0)
    qdd = np.gradient(qd, step, axis=0)
    return _Segment(q, qd, qdd, tau, even, derivative, *smoothed_base(log, rest, step), sections, len(time))


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
