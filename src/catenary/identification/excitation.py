"""Poses and Fourier motions that show a robot's parameters within its limits."""

from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError, LimitError
from catenary.identification.base_parameters import BaseParameters, base_parameters
from catenary.identification.fourier_series import FourierSeries, series_at_rest
from catenary.identification.identify_options import Terms
from catenary.identification.motion_limits import DIP, CheckedMotion, MotionLimits, Room
from catenary.identification.parameters import Parameters

CANDIDATES = 20  # poses to choose each static one from
POSE_ATTEMPTS = 20  # at finding one that is free


@dataclass(frozen=True)
class Excitation:
    """Rows of a motion, or poses to hold, and how well they show the base parameters."""

    time: Floats  # (N,) [s]; row numbers of static poses
    q: Floats  # (N, n)
    qd: Floats
    qdd: Floats
    condition: float  # of the regressor, columns scaled to length one
    base: BaseParameters
    terms: Terms
    series: FourierSeries | None = None  # of a motion: what it is between its rows
    checked: CheckedMotion | None = None


def static_poses(limits: MotionLimits, count: int, rng: np.random.Generator) -> Excitation:
    """Choose poses to hold, each the best of twenty random ones beside those before it (greedy log-determinant).

    Nothing touches in them, and the robot can hold its weight; the ways from one to the next are not looked at.
    """
    model, room, g = limits.model, limits.room, limits.gravity
    base = shown_parameters(Parameters(model, "static"), room, g, rng)
    least = -(-base.count // model.n)
    if count < least:
        raise InputError(f"{count} poses cannot show {base.count} base parameters: expected {least} or more")
    scale, poses = None, []
    information = np.zeros((base.count, base.count))
    for _ in range(count):
        q = free_poses(limits, rng, CANDIDATES)
        Y = base.regressor(q, np.zeros_like(q), np.zeros_like(q), g)
        if scale is None:
            scale = np.sqrt(np.mean(Y**2, axis=(0, 1)))
            scale[scale == 0.0] = 1.0
            information = 1e-6 * np.eye(base.count)
        Y = Y / scale
        gains = np.linalg.slogdet(information + np.einsum("cab,cad->cbd", Y, Y))[1]
        best = int(np.argmax(gains))
        poses.append(q[best])
        information = information + Y[best].T @ Y[best]
    q = np.array(poses)
    zero = np.zeros_like(q)
    return Excitation(
        np.arange(count, dtype=float), q, zero, zero, condition_of(base, q, zero, zero, g), base, "static"
    )


def shown_parameters(parameters: Parameters, room: Room, gravity: Floats, rng: np.random.Generator) -> BaseParameters:
    """Return the base parameters that motion within the limits shows."""
    low, high = room.inner()
    size = (200, parameters.model.n)
    moving = np.zeros(size), np.zeros(size)
    if parameters.terms == "full":
        moving = rng.normal(size=size), 5.0 * rng.normal(size=size)
    return base_parameters(parameters, gravity, (rng.uniform(low, high, size), *moving), rng)


def condition_of(base: BaseParameters, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> float:
    """Return the condition number of the regressor, columns scaled to length one."""
    Y = base.regressor(q, qd, qdd, gravity).reshape(-1, base.count)
    size = np.linalg.norm(Y, axis=0)
    return float(np.linalg.cond(Y / np.where(size > 0.0, size, 1.0)))


ROWS = 120  # of a motion whose condition is looked at
POSES = 300  # drawn within the limits, from which motions take their centres
SHRUNK = 0.75  # what is left of a motion's amplitude where it did not keep a limit
SHRINKS = 8  # times at most
KEPT = 0.98  # of the limits of velocity and acceleration


@dataclass(frozen=True)
class _Draw:
    """What is searched: coefficients (2, harmonics, n), shares of the largest amplitude, places of the centre (n,)."""

    coefficients: Floats
    share: Floats
    place: Floats  # 0 to 1 of the room that the amplitude leaves


def fourier_motion(
    limits: MotionLimits,
    rng: np.random.Generator,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    rate: float = 200.0,
    trials: int = 300,
) -> Excitation:
    """Design one period of a motion that begins and ends at rest, keeps all limits, and shows full dynamics well.

    Coefficients by random search from the best of `trials`, a third of them anywhere, the others around the best so
    far. Each joint is scaled to the larger part of its range that its velocity limit allows; the share of it, and the
    place of its centre, are part of the search. Motions drawn anywhere are shrunk until they keep torques,
    accelerations and distances; around the best, what shows more is taken if it keeps them. At last the best is checked
    at every instant; where it fails, the best before it is.

    Args:
        limits: What to keep, of which robot; it needs no inertia.
        period: [s].
        harmonics: Three or more: with fewer nothing begins at rest.
        rate: Rows per second.
        trials: How many motions are looked at.
    """
    if not (period > 0.0 and rate > 0.0 and trials >= 1 and harmonics >= 3 and period * rate >= 2 * ROWS):
        raise InputError(
            f"fourier: expected a period and a rate of {2 * ROWS} rows at least, three or more harmonics and one "
            f"or more trials; got {period:g} s, {rate:g} Hz, {harmonics} harmonics, {trials} trials"
        )
    base = shown_parameters(Parameters(limits.model, "full"), limits.room, limits.gravity, rng)
    search = _MotionSearch(limits, base, period, rng)
    for trial in range(trials):
        if not search.best or trial < trials // 3:
            search.anywhere(harmonics)
        else:
            search.around(0.5 * (1.0 - trial / trials) + 0.05)
    series, checked = search.proven()
    time = np.arange(round(period * rate) + 1) / rate
    q, qd, qdd = series.sample(time)
    condition = condition_of(base, q, qd, qdd, limits.gravity)
    return Excitation(time, q, qd, qdd, condition, base, "full", series, checked)


class _MotionSearch:
    """Motions that seemed to keep all limits, each better than the one before it."""

    def __init__(self, limits: MotionLimits, base: BaseParameters, period: float, rng: np.random.Generator) -> None:
        self.limits, self.base, self.period, self.rng = limits, base, period, rng
        self.best: list[tuple[float, _Draw, FourierSeries]] = []
        self.times = np.arange(ROWS) * period / ROWS
        self.centres = free_poses(limits, rng, POSES) if limits.is_narrow else None

    def anywhere(self, harmonics: int) -> None:
        """Try a motion that has nothing to do with those before it."""
        n = self.limits.model.n
        draw = _Draw(self.rng.normal(size=(2, harmonics, n)), self.rng.uniform(0.6, 1.0, n), np.full(n, 0.5))
        if self.centres is None:
            self._take(draw, self._scaled(draw))
            return
        if self.best and self._condition(self._scaled(draw)) > self.best[-1][0]:
            return  # what shows less at its full size is not worth shrinking
        centre = self.centres[self.rng.integers(len(self.centres))]
        found = shrunk_motion(draw.coefficients, draw.share, centre, self.period, self.limits)
        if found is not None:
            series, share, place = found
            self._take(_Draw(draw.coefficients, share, place), series)

    def around(self, step: float) -> None:
        """Try a motion near the best so far."""
        _, last, _ = self.best[-1]
        n = self.limits.model.n
        # of one joint, or several, or all: where something is near, few can move at a time
        moved = step * (self.rng.permutation(n) < self.rng.integers(1, n + 1))
        draw = _Draw(
            last.coefficients + moved * self.rng.normal(size=last.coefficients.shape),
            np.clip(last.share + 0.3 * moved * self.rng.normal(size=n), 0.1, 1.0),
            np.clip(last.place + 0.3 * moved * self.rng.normal(size=n), 0.0, 1.0),
        )
        self._take(draw, self._scaled(draw))

    def proven(self) -> tuple[FourierSeries, CheckedMotion]:
        """Return the best motion that keeps all limits at every instant."""
        fault = "no motion that was tried keeps all limits"
        for _, _, series in reversed(self.best):
            checked = self.limits.check(series)
            if checked.fault is None:
                return series, checked
            fault = checked.fault
        raise LimitError(
            f'robot "{self.limits.model.name}": no motion found that keeps all limits: {fault}; more trials, a '
            "longer period or a smaller margin may find one"
        )

    def _scaled(self, draw: _Draw) -> FourierSeries:
        return scaled_motion(draw.coefficients, draw.share, draw.place, self.period, self.limits.room)

    def _condition(self, series: FourierSeries) -> float:
        return condition_of(self.base, *series.sample(self.times), self.limits.gravity)

    def _take(self, draw: _Draw, series: FourierSeries) -> None:
        condition = self._condition(series)
        if (not self.best or condition < self.best[-1][0]) and self.limits.seem_kept(series):
            self.best.append((condition, draw, series))


def free_poses(limits: MotionLimits, rng: np.random.Generator, count: int) -> Floats:
    """Return those of `count` poses drawn within the limits that can be rested in, (M, n), one or more."""
    size = (count, limits.model.n)
    if not limits.is_narrow:
        return rng.uniform(*limits.room.inner(), size)
    for _ in range(POSE_ATTEMPTS):
        drawn = rng.uniform(*limits.room.inner(), size)
        if len(free := limits.free_poses(drawn)):
            return free
    why = "its own weight cannot be held"
    if (scene := limits.scene) is not None:
        close = scene.touching(drawn, limits.margin + DIP)
        often = [int(k) for k in np.argsort(-close.sum(axis=0), kind="stable")[:3]]
        told = (f"{' and '.join(scene.names(k))} in {100 * close[:, k].mean():.0f} %" for k in often)
        why += f", or its bodies come within {1000 * limits.margin:g} mm of what is about them: {', '.join(told)}"
    raise InputError(
        f'robot "{limits.model.name}": none of {POSE_ATTEMPTS * count} poses within the limits is free: {why}'
    )


def scaled_motion(coefficients: Floats, share: Floats, place: Floats, period: float, room: Room) -> FourierSeries:
    """Return the motion of some coefficients whose joints go over `share` of what room and velocity allow.

    `place` tells where, 0 at the lower end of the room that the motion leaves, 1 at the upper.
    """
    unit, reach, middle = _unit(coefficients, period)
    low, high = room.inner()
    largest = _largest(unit, reach, room)
    left = (high - low) - share * largest * reach
    centre = low + 0.5 * share * largest * reach + place * left - share * largest * middle
    scaled = unit.scaled(share * largest)
    return FourierSeries(scaled.a, scaled.b, centre, period)


def shrunk_motion(
    coefficients: Floats, share: Floats, centre: Floats, period: float, limits: MotionLimits
) -> tuple[FourierSeries, Floats, Floats] | None:
    """Return the motion about a centre, its amplitudes shrunk until it keeps all limits, with its shares and places.

    None where it does not at a tenth of them.
    """
    unit, reach, _ = _unit(coefficients, period)
    low, high = limits.room.inner()
    largest = _largest(unit, reach, limits.room)
    for _ in range(SHRINKS):
        span = share * largest * reach
        left = np.maximum((high - low) - span, 1e-12)
        place = np.clip((centre - 0.5 * span - low) / left, 0.0, 1.0)
        series = scaled_motion(coefficients, share, place, period, limits.room)
        if limits.seem_kept(series):
            return series, share, place
        share = share * SHRUNK
    return None


def _unit(coefficients: Floats, period: float) -> tuple[FourierSeries, Floats, Floats]:
    """Return the unscaled motion, what its joints reach over, and the middle of that."""
    unit = series_at_rest(coefficients, period)
    q, _, _ = unit.sample(unit.grid())
    # between two instants of the grid it reaches less than a per cent further
    return unit, np.ptp(q, axis=0) * 1.01, 0.5 * (q.max(axis=0) + q.min(axis=0))


def _largest(unit: FourierSeries, reach: Floats, room: Room) -> Floats:
    """Return the largest amplitudes (n,) that position, velocity and acceleration allow."""
    low, high = room.inner()
    fastest = np.abs(unit.sample(unit.grid())[1]).max(axis=0)
    allowed = np.minimum((high - low) / reach, KEPT * room.velocity / fastest)
    return np.asarray(np.minimum(allowed, KEPT * room.acceleration / unit.acceleration_bound))
