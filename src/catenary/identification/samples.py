"""Samples for identification: a recording's filtered positions, velocities, accelerations and torques, checked.

Signals of a recording may describe the base, row by row, in base axes. `gravity:x`, `:y`, `:z` [m/s2] is the free-fall
acceleration less the acceleration of the base's origin: the negated reading of an accelerometer there. A reading from
elsewhere (`IdentifyOptions.base_sensor`) is converted with the base's rotation. `base_rate:x` ... [rad/s] is the base's
angular velocity, `base_acceleration:x` ... [rad/s2] its derivative, computed from the rate if missing. `base_force:x`
... [N] and `base_moment:x` ... [Nm], about the base's origin, are the wrench on the base as a sensor under it measures:
six more axes of the robot (`robots/submodels.py`).

Friction depends on more than one row. The filter of torques rounds the steps of Coulomb friction, so its column passes
the same filter. Presliding friction depends on the path since the last reversals. Both are computed over the whole
recording before rows are left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.dynamics.actuation_loads import known_torque
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.errors import InputError
from catenary.identification.identify_options import IdentifyOptions, filter_of, known_rotors
from catenary.identification.velocities import MARGIN, VelocityFault, velocity_faults
from catenary.kernels.compiled import compiled
from catenary.plant import Joints, MotionLog
from catenary.robots.actuation import SignalFilter
from catenary.robots.friction_terms import FrictionTerm
from catenary.robots.model import RobotModel
from catenary.robots.submodels import BASE_JOINTS, on_base_joints
from catenary.spatial import LEVEL
from catenary.verdict.units_and_scale import MAX_POSITIONS, limits_of


@dataclass(frozen=True, eq=False)
class FrictionHistory:
    """A recording's filtered positions and velocities, and the rows kept of them."""

    # q, qd (M, n) of every stretch without a gap in time, and the number of rows cut at each end
    segments: tuple[tuple[Floats, Floats, int], ...]
    sections: Floats  # second-order sections of the filter
    kept: NDArray[np.int64]  # rows kept, counted after the cut

    def load(self, friction: FrictionTerm, c: Floats, scale: float, coulomb_velocity: float) -> Floats:
        """Return a term's load (N,) along c (n,) on the rows kept, per unit of its parameter and of load."""
        parts = []
        for q, qd, cut in self.segments:
            if friction.memory is not None:
                load = path_load(friction.memory, q @ c, scale)
            else:
                load = _filtered(self.sections, friction.load(qd @ c, scale, coulomb_velocity, np), cut)
            parts.append(load[cut : len(load) - cut])
        return np.concatenate(parts)[self.kept]


def path_load(memory: Callable[[Floats, float, Floats], None], s: Floats, scale: float) -> Floats:
    """Return the load (N,) of friction that depends on the history of its path s (N,), from rest."""
    out = np.empty(len(s))
    _compiled_memory(memory)(np.ascontiguousarray(s), scale, out)
    return out


_compiled_memory = cache(compiled)


def of_model(log: MotionLog, model: RobotModel) -> MotionLog:
    """Return a recording with its joints in a robot's order; for base joints, with the recorded wrench."""
    if BASE_JOINTS[0] not in model.joint_names or BASE_JOINTS[0] in log.joint_names:
        return log.of_robot(model, model.name)
    own = Joints(model.joint_names[len(BASE_JOINTS) :], model.joint_units[len(BASE_JOINTS) :])
    log, still = log.of_robot(own, model.name), np.zeros((len(log), len(BASE_JOINTS)))
    force, moment = (_vector(log, name) for name in ("base_force", "base_moment"))
    if force is None or moment is None:
        raise InputError(f'recording "{log.name}": has no base_force and base_moment, which others have: expected both')
    added = {"q_nominal": still, "qd": still, "tau": np.column_stack([force, moment])}
    arrays = {key: np.hstack([new, had]) for key, new in added.items() if (had := getattr(log, key)) is not None}
    changes: dict[str, Any] = arrays | {key: getattr(model, key) for key in ("joint_names", "joint_units")}
    return replace(log, q_encoder=None, q_reported=None, **changes)


def with_base_wrench(model: RobotModel, logs: Sequence[MotionLog]) -> RobotModel:
    """Return the robot, on base joints if a recording has the wrench under its base."""
    held = any(f"{name}:x" in log.signals for log in logs for name in ("base_force", "base_moment"))
    return on_base_joints(model) if held else model


def check_positions(log: MotionLog, model: RobotModel) -> None:
    """Refuse a recording whose positions are beyond the robot's limits.

    Args:
        log, model: Recording, and robot.
    """
    where, log = f'recording "{log.name}"', of_model(log, model)
    low, high = limits_of(log, model, MAX_POSITIONS)
    least, largest = log.q_nominal.min(axis=0), log.q_nominal.max(axis=0)
    for i in np.flatnonzero((least < low) | (largest > high)):
        name, unit = model.joint_names[i], model.joint_units[i]
        wrong = "degrees" if unit == "rad" else "mm"
        raise InputError(
            f"{where}: joint {name} goes from {least[i]:.4g} to {largest[i]:.4g}, expected {unit} between {low[i]:.4g} "
            f"and {high[i]:.4g}: is it in {wrong}, or another joint's?"
        )


_BASE_UNITS = {"gravity": "m/s2", "base_rate": "rad/s", "base_acceleration": "rad/s2"}
_MIN_GRAVITY, _MAX_GRAVITY = 1.0, 30.0  # [m/s2] plausible gravity; beyond, it is in another unit


def base_of(log: MotionLog) -> dict[str, Floats]:
    """Return gravity, angular velocity and angular acceleration of the base, (N, 3) each, if a log has them."""
    signals = {name: values for name in _BASE_UNITS if (values := _vector(log, name)) is not None}
    for name, needed in (("base_rate", "gravity"), ("base_acceleration", "base_rate")):
        if name in signals and needed not in signals:
            raise InputError(f'recording "{log.name}": has {name} and no {needed}: expected {needed}:x, :y and :z too')
    if "gravity" in signals:
        size = float(np.median(np.linalg.norm(signals["gravity"], axis=1)))
        if not _MIN_GRAVITY < size < _MAX_GRAVITY:
            raise InputError(
                f'recording "{log.name}": gravity has a size of {size:.3g}, expected m/s2, about 9.8; is it in g?'
            )
    return signals


def _vector(log: MotionLog, name: str) -> Floats | None:
    columns = [log.signals.get(f"{name}:{axis}") for axis in "xyz"]
    missing = [axis for axis, column in zip("xyz", columns, strict=True) if column is None]
    if len(missing) == 3:
        return None
    if missing:
        raise InputError(f'recording "{log.name}": {name}:{missing[0]} is missing beside its other axes')
    values: Floats = np.column_stack([column for column in columns if column is not None])
    if not np.isfinite(values).all():
        raise InputError(
            f'recording "{log.name}": {name} is not finite at row {np.argwhere(~np.isfinite(values))[0, 0]}'
        )
    return values


_ALL_ROWS = slice(None)
_ROW_ARRAYS = ("q", "qd", "qdd", "tau", "known", "time", "base", "carried", "derived")
_KEPT_COLUMNS_BYTES = 2e8  # largest cached regressor of a recording, which a fit needs a dozen times
HELD_OUT = " (held-out blocks)"  # suffix of a recording's name for its held-out blocks
_IRREGULAR_SPREAD = 0.01  # relative spread of time steps above which a recording is resampled at even steps
_BRIDGED_PERIODS = 1.0  # gap in periods of the cut-off; interpolation is 5 % off at a tenth of that frequency
_MIN_ROWS_LEFT = 30  # least rows of a stretch after the cut
_NOTED_ROWS_RATIO = 1.1  # resampled rows per recorded row above which a note is given


@dataclass(frozen=True)
class Samples:
    """Filtered rows of one recording, (N, n) in rad, m, s, Nm, N; `tau` excludes known torques."""

    name: str
    q: Floats
    qd: Floats
    qdd: Floats
    tau: Floats
    known: Floats  # (N, n) known torques, subtracted from the measured ones
    time: Floats  # (N,) [s]; row numbers for a recording at rest
    independent: float  # share of the rows that count as independent, as the filter correlates neighbours
    gravity: Floats = field(default_factory=LEVEL.copy)  # [m/s2] in base axes: (N, 3) as recorded, or (3,) as stated
    base: Floats | None = None  # (N, 2, 3) angular velocity and acceleration of the base [rad/s, rad/s2], likewise
    history: FrictionHistory | None = None  # of the motion, for friction with memory; none at rest
    carried: Floats | None = None  # (N, n) torques of the links, on which load-dependent friction depends
    notes: tuple[str, ...] = ()  # on gaps in time, and on rows left out or resampled
    derived: Floats | None = None  # (N, 2, n) velocities and accelerations by positions, if velocities were recorded
    # cache: a key, and the links' regressor (N, n, 10 L); shared by copies of the same rows
    kept: list[tuple[tuple[Any, ...], Floats]] = field(default_factory=list, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.q)

    def rows(self, which: NDArray[np.bool_], name: str) -> "Samples":
        """Return a subset of the rows under another name."""
        keys = [*_ROW_ARRAYS, *["gravity"] * self.holds_gravity]
        chosen: dict[str, Any] = {key: values[which] for key in keys if (values := getattr(self, key)) is not None}
        if self.history is not None:
            chosen["history"] = replace(self.history, kept=self.history.kept[which])
        few = replace(self, name=name, kept=[], **chosen)
        few.kept.extend((few._of(*of[:3]), Y[which]) for of, Y in self.kept)
        return few

    @property
    def holds_gravity(self) -> bool:
        """Whether gravity was recorded, row by row."""
        return self.gravity.ndim == 2

    def motion(self, part: slice = _ALL_ROWS) -> tuple[Floats, Floats, Floats, Floats, BaseMotion | None]:
        """Return q, qd, qdd, gravity and the base's rotation of some rows; None if that was not recorded."""
        down = self.gravity[part] if self.holds_gravity else self.gravity
        base = None if self.base is None else BaseMotion(self.base[part, 0], self.base[part, 1])
        return self.q[part], self.qd[part], self.qdd[part], down, base

    def link_columns(self, model: RobotModel, part: slice = _ALL_ROWS) -> Floats:
        """Return the regressor of all links (N, n, 10 L), cached for a short recording."""
        bytes_needed = 8.0 * self.q.size * PER_LINK * len(model.link_names)
        if bytes_needed > _KEPT_COLUMNS_BYTES:
            return torque_regressor(model, *self.motion(part))
        of = self._of(model.tree, model.coupling, model.offset)
        if not self.kept or not all(had is now for had, now in zip(self.kept[0][0], of, strict=True)):
            self.kept[:] = [(of, torque_regressor(model, *self.motion()))]
        return self.kept[0][1][part]

    def _of(self, *model: Any) -> tuple[Any, ...]:
        return *model, self.q, self.qd, self.qdd, self.gravity, self.base

    def velocity_faults(self, model: RobotModel) -> list[VelocityFault]:
        """Return faults that are likelier than sound velocities, likeliest last; none without recorded velocities."""
        if self.derived is None:
            return []
        step = float(np.median(np.diff(self.time)))
        faults = velocity_faults(model, self.qd, self.derived[:, 0], step)
        return sorted(fault for fault in faults if fault.gain > 0.0)


def prepare(log: MotionLog, model: RobotModel, options: IdentifyOptions, *, within_limits: bool = True) -> Samples:
    """Return the filtered rows of a recording: accelerations derived, ends cut, known torques subtracted.

    The filter is a zero-phase Butterworth. Accelerations, and velocities that were not recorded, are central
    differences. A step back or a gap in time separates parts, which are filtered and cut separately; parts that are too
    short for the filter are left out. Recordings at rest are not filtered.

    Args:
        log, model, options: The recording with torques, the robot, and options of the identification.
        within_limits: Refuse positions beyond the robot's limits, and velocities that do not belong to them.

    Raises:
        InputError: No torques or no time, positions beyond the limits, or parts too short for the filter.
    """
    log = of_model(log, model)
    if log.tau is None:
        raise InputError(f'recording "{log.name}": has no torques (`tau`), which dynamics are identified from')
    if within_limits:
        check_positions(log, model)
    actuation, stated = model.assumed_actuation, as_array("gravity", options.gravity, (3,))
    if options.terms == "static":
        zero = np.zeros(log.q_nominal.shape)
        known = known_torque(actuation, log.q_nominal)
        places, gravity = np.arange(len(log), dtype=float), base_of(log).get("gravity", stated)
        return Samples(log.name, log.q_nominal, zero, zero, log.tau - known, known, places, 1.0, gravity=gravity)
    if log.time is None:
        raise InputError(
            f'recording "{log.name}": has no time: full dynamics need `fs` [Hz] or `t` [s]; '
            "poses at rest need neither (terms static)"
        )
    settings = filter_of(model, options)
    stretches, gaps = _stretches(log, settings)
    grids = [(part, *_grid(log.time[part])) for part in stretches]
    used = [grid for grid in grids if len(grid[1]) >= 2 * _cut_rows(settings, grid[2]) + _MIN_ROWS_LEFT]
    parts = [_segment(log, *grid, settings, options.base_sensor) for grid in used]
    if not parts:
        longest, even, step = max(grids, key=lambda grid: len(grid[1]))
        between = f", between {len(gaps)} gap(s) in time" if len(gaps) else ""
        raise InputError(
            f'recording "{log.name}": {len(even)} rows from row {longest.start}{between}: shorter than the filter, '
            f"which needs {2 * _cut_rows(settings, step) + _MIN_ROWS_LEFT} ({settings.cut_s:.2g} s cut at each end)"
        )
    cuts = [_cut_rows(settings, step) for _, _, step in used]
    pieces = list(zip(parts, cuts, strict=True))
    rows = {key: np.concatenate([part[key][c : len(part[key]) - c] for part, c in pieces]) for key in parts[0]}
    recorded, made = sum(part.stop - part.start for part, _, _ in used), sum(len(even) for _, even, _ in used)
    notes = _notes(len(stretches) - len(used), gaps, (len(log), recorded, made, len(rows["q"])))
    q, qdd, time = rows["q"], rows["qdd"], rows["time"]
    known = known_torque(actuation, q) + known_rotors(model, options) * qdd
    rate = 1.0 / float(np.median(np.diff(time)))
    sections = _filter(settings, 2.0 * used[0][2] * settings.cutoff_hz)
    history = FrictionHistory(tuple((part["q"], part["qd"], c) for part, c in pieces), sections, np.arange(len(q)))
    motion = q, rows["qd"], qdd, rows["tau"] - known, known, time
    of_base, derived = (rows.get("gravity", stated), rows.get("base")), rows.get("derived")
    independent = min(1.0, 2.0 * settings.cutoff_hz / rate)
    samples = Samples(log.name, *motion, independent, *of_base, history, notes=notes, derived=derived)
    faults = samples.velocity_faults(model) if within_limits else []
    if faults and faults[-1].remedy and faults[-1].gain > MARGIN:
        raise InputError(f'recording "{log.name}": {faults[-1].says}; fix: {faults[-1].remedy}')
    return samples


def _stretches(log: MotionLog, settings: SignalFilter) -> tuple[list[slice], Floats]:
    """Return the stretches without a gap in time, and the lengths of the gaps [s]."""
    steps = np.diff(log.time) if log.time is not None else np.zeros(0)
    if not np.count_nonzero(steps) or float(np.median(steps)) <= 0.0:
        raise InputError(f'recording "{log.name}": the time stamp does not change on most rows')
    gaps = log.gaps(_BRIDGED_PERIODS / settings.cutoff_hz)
    bounds = sorted({*log.starts, *gaps, len(log)})
    return [slice(first, last) for first, last in pairwise(bounds)], steps[np.array(gaps, dtype=int) - 1]


def _notes(short: int, gaps: Floats, rows: tuple[int, int, int, int]) -> tuple[str, ...]:
    """Return notes on gaps and on rows left out or resampled; rows are counts of all, used, resampled and kept."""
    every, recorded, made, kept = rows
    longest = f"{len(gaps)} gap(s) in time, the longest {gaps.max(initial=0.0):.3g} s"
    notes = {
        f"{longest}: rows between were filtered, and cut at both ends, by itself": len(gaps) > 0,
        f"{short} stretch(es) of time shorter than the filter needs, {every - recorded} rows, were left out": short,
        f"{recorded} rows were brought to {made} even ones, on straight lines": made > _NOTED_ROWS_RATIO * recorded,
    }
    return tuple(f"{note}; {kept} rows are used of {every}" for note, is_so in notes.items() if is_so)


def _grid(time: Floats) -> tuple[Floats, float]:
    """Return even times for a stretch (M,), its own if they are even, and their step [s]."""
    steps = np.diff(time)
    if not len(steps):
        return time, 1.0
    usual = float(np.median(steps))
    # for bursts half the mean, so that at most two rows are made of one
    step = max(usual, 0.5 * float(np.mean(steps)))
    if step > 0.0 and np.ptp(steps) > _IRREGULAR_SPREAD * step:
        return np.arange(time[0], time[-1], step), step
    return time, step


def _segment(
    log: MotionLog, part: slice, even: Floats, step: float, settings: SignalFilter, sensor: tuple[float, float, float]
) -> dict[str, Floats]:
    """Return a stretch's signals by name, resampled and filtered, with derivatives, before the cut."""
    assert log.time is not None
    recorded: dict[str, Floats | None] = {"q": log.q_nominal, "tau": log.tau, "qd": log.qd, **base_of(log)}
    time, signals = log.time[part], {key: values[part] for key, values in recorded.items() if values is not None}
    if not np.array_equal(even, time):
        increasing = np.concatenate([[True], np.diff(time) > 0.0])  # without repeated stamps
        signals = {
            key: np.column_stack([np.interp(even, time[increasing], column[increasing]) for column in values.T])
            for key, values in signals.items()
        }
    if settings.cutoff_hz >= 0.5 / step:
        raise InputError(
            f'recording "{log.name}": recorded at {1.0 / step:g} Hz: the cut-off {settings.cutoff_hz:g} Hz must be '
            "below half of it; is time in ms, us or ns?"
        )
    sections, cut = _filter(settings, 2.0 * step * settings.cutoff_hz), _cut_rows(settings, step)
    made = {key: _filtered(sections, values, cut) for key, values in signals.items()}
    derivative = np.gradient(made["q"], step, axis=0)
    if log.qd is not None:
        made["derived"] = np.stack([derivative, np.gradient(derivative, step, axis=0)], axis=1)
    made["qdd"] = np.gradient(made.setdefault("qd", derivative), step, axis=0)
    if (rate := made.get("base_rate")) is not None:
        turning = made["base_acceleration"] if "base_acceleration" in made else np.gradient(rate, step, axis=0)
        made["base"] = np.stack([rate, turning], axis=1)
        made["gravity"] += np.cross(turning, sensor) + np.cross(rate, np.cross(rate, sensor))
    elif np.any(sensor):
        raise InputError(f'recording "{log.name}": has no base_rate, which base_sensor away from the origin needs')
    return made | {"time": even}


def _filter(settings: SignalFilter, share: float) -> Floats:
    """Return the filter's second-order sections; the cut-off is a share of the Nyquist frequency."""
    from scipy.signal import butter

    return np.asarray(butter(settings.order, share, output="sos"))


def _filtered(sections: Floats, values: Floats, mirrored: int) -> Floats:
    """Return signals (N, ...) filtered forwards and backwards, with `mirrored` rows of padding at both ends."""
    from scipy.signal import sosfiltfilt

    return np.asarray(sosfiltfilt(sections, values, axis=0, padlen=min(mirrored, len(values) - 1)))


def _cut_rows(settings: SignalFilter, step: float) -> int:
    return int(np.ceil(settings.cut_s / step))


def alternate_blocks(samples: Samples, length: float) -> tuple[Samples, Samples]:
    """Split a recording into two sets of alternate blocks of a length [s, or rows at rest]."""
    held_out = np.floor((samples.time - samples.time[0]) / length).astype(np.int64) % 2 == 1
    if not held_out.any():
        raise InputError(
            f'recording "{samples.name}": spans {samples.time[-1] - samples.time[0]:.4g}, less than two blocks '
            f"of {length:g}"
        )
    return samples.rows(~held_out, samples.name), samples.rows(held_out, f"{samples.name}{HELD_OUT}")


FOLDS = 5
_FOLD_TURNS = 2  # blocks per recording and fold


def fold_of_rows(samples: Samples) -> NDArray[np.int64]:
    """Return the fold of each row (N,): consecutive blocks of time take the folds in turn."""
    block = np.arange(len(samples)) * (FOLDS * _FOLD_TURNS) // max(len(samples), 1)
    return np.asarray(block % FOLDS, dtype=np.int64)
