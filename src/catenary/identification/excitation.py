"""Poses and Fourier motions that show a robot's parameters; what they keep: limits, and distances from obstacles."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.collision.scene import Clearance, CollisionScene
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import ExcitationError, InputError, LimitError
from catenary.identification.base_parameters import BaseParameters, Parameters, base_parameters
from catenary.identification.identify_options import Terms
from catenary.identification.least_squares import condition_of_triangle
from catenary.robots.model import RobotModel

_GRID_INSTANTS = 40  # instants for each harmonic at which extremes are looked for


@dataclass(frozen=True)
class FourierSeries:
    """q_i = centre + sum_k a_k / (k w) sin k w t - b_k / (k w) cos k w t, with w = 2 pi / period.

    (Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 13(5), 1997.)
    """

    a: Floats  # (harmonics, n) of the velocity's cosines [rad/s or m/s]
    b: Floats  # (harmonics, n) of its sines
    centre: Floats  # (n,) [rad or m]
    period: float  # [s]

    @property
    def frequencies(self) -> Floats:
        """(harmonics,) [rad/s]."""
        return np.asarray(2.0 * np.pi / self.period * np.arange(1, len(self.a) + 1), dtype=float)

    @property
    def duration(self) -> float:
        """One period [s]."""
        return self.period

    @property
    def acceleration_bound(self) -> Floats:
        """(n,) what no acceleration exceeds [rad/s2 or m/s2]: the sum of the harmonics' amplitudes."""
        return np.asarray(self.frequencies @ np.hypot(self.a, self.b))

    def sample(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return positions, velocities, accelerations, (N, n) each, at times (N,) [s]."""
        w = self.frequencies
        sine, cosine = np.sin(np.outer(times, w)), np.cos(np.outer(times, w))
        return (
            self.centre + sine @ (self.a / w[:, None]) - cosine @ (self.b / w[:, None]),
            cosine @ self.a + sine @ self.b,
            -sine @ (self.a * w[:, None]) + cosine @ (self.b * w[:, None]),
        )

    def grid(self) -> Floats:
        """Return instants that lie close enough for extremes to be found between them."""
        return np.linspace(0.0, self.period, _GRID_INSTANTS * len(self.a), endpoint=False)

    def extremes(self) -> tuple[Floats, Floats, Floats]:
        """Return bounds of the whole motion: lowest and highest position, highest speed, (n,) each.

        Between instants h apart an extreme exceeds the nearer one by at most h^2 / 8 of the second derivative's bound.
        """
        times = self.grid()
        h = times[1]
        q, qd, _ = self.sample(times)
        slack = h**2 / 8.0 * self.acceleration_bound
        faster = h**2 / 8.0 * (self.frequencies**2 @ np.hypot(self.a, self.b))  # the jerk's bound
        return q.min(axis=0) - slack, q.max(axis=0) + slack, np.abs(qd).max(axis=0) + faster


def series_at_rest(coefficients: Floats, period: float) -> FourierSeries:
    """Return the series of free coefficients (2, harmonics, n) about zero, changed least so that it starts at rest.

    The velocity sum a cos + b sin and the acceleration sum -a w sin + b w cos are zero at the start.
    """
    w = 2.0 * np.pi / period * np.arange(1, coefficients.shape[1] + 1)
    a = coefficients[0] - coefficients[0].mean(axis=0)
    b = coefficients[1] - w[:, None] * (w @ coefficients[1]) / (w @ w)
    return FourierSeries(a, b, np.zeros(coefficients.shape[2]), period)


_LIMIT_MARGIN = 0.05  # of a coordinate's range kept clear of its limits
_EFFORT_SHARE = 0.95  # of the torque limit that a motion may take, by the robot's own masses
_TORQUE_ROWS = 1000  # of a motion at which torques are compared with their limits
_SEARCH_ROWS = 160  # of a motion that are looked at while it is searched for
_DISTANCE_DIP_M = 0.003  # [m] by which a distance may fall between these rows; the search keeps more than the margin


@dataclass(frozen=True)
class Room:
    """Limits of position and velocity, all finite, and of acceleration and torque, inf where there are none."""

    lower: Floats  # (n,)
    upper: Floats
    velocity: Floats
    acceleration: Floats
    effort: Floats

    def inner(self) -> tuple[Floats, Floats]:
        """Return the limits of position that designs keep to, a twentieth of the range inside."""
        slack = _LIMIT_MARGIN * (self.upper - self.lower)
        return self.lower + slack, self.upper - slack


def motion_room(model: RobotModel, **narrower: ArrayLike) -> Room:
    """Return the limits to stay within: the robot's own, or by their names in `Room` narrower ones (n,)."""
    own = (model.lower, model.upper, model.velocity_limit, np.full(model.n, np.inf), model.effort_limit)
    room = {
        each.name: as_array(each.name, narrower.get(each.name, limit), (model.n,), finite=False)
        for each, limit in zip(fields(Room), own, strict=True)
    }
    low, high, fastest, accelerated, strongest = room.values()
    beyond = (low < model.lower) | (high > model.upper) | (fastest > model.velocity_limit)
    beyond |= strongest > model.effort_limit
    for i, name in enumerate(model.joint_names):
        where = f'robot "{model.name}"'
        for key in ("lower", "upper", "velocity"):
            if not np.isfinite(room[key][i]):
                raise InputError(f"{where}: no {key} limit of {name}: give --{key} for all {model.n} joints")
        if not low[i] < high[i] or not fastest[i] > 0.0:
            raise InputError(f"{where}: {name}: expected lower < upper and a velocity above zero")
        if not (accelerated[i] > 0.0 and strongest[i] > 0.0):
            raise InputError(f"{where}: {name}: expected limits of acceleration and torque above zero")
        if beyond[i]:
            raise InputError(f"{where}: {name}: the limits given go beyond the robot's own")
    return Room(low, high, fastest, accelerated, strongest)


@dataclass(frozen=True)
class MotionLimits:
    """All that a motion of one robot must keep."""

    model: RobotModel
    room: Room
    gravity: Floats  # (3,) [m/s2] in base axes
    scene: CollisionScene | None = None  # None: collisions are unchecked
    margin: float = 0.01  # [m]

    @property
    def has_torques(self) -> bool:
        """Whether the robot's masses tell torques, and it has limits of them."""
        known = not self.model.missing_inertia and not self.model.missing_tensor
        return known and bool(np.isfinite(self.room.effort).any()) and bool(self.model.tree.mass.any())

    @property
    def is_narrow(self) -> bool:
        """Whether anything beside limits of position and velocity is to be kept."""
        return self.scene is not None or self.has_torques or bool(np.isfinite(self.room.acceleration).any())

    def torque(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """Return the torques (N, n) of a motion by the robot's own masses, without friction [Nm or N]."""
        return inverse_dynamics(self.model, q, qd, qdd, self.gravity)

    def free_poses(self, q: Floats) -> Floats:
        """Return those of configurations (N, n) in which the arm may rest, (M, n)."""
        free: NDArray[np.bool_] = np.ones(len(q), dtype=bool)
        if self.has_torques:
            still = np.zeros_like(q)
            over = np.abs(self.torque(q, still, still)) > _EFFORT_SHARE * self.room.effort
            free = np.asarray(~over.any(axis=1))
        if self.scene is not None and free.any():
            free[free] = ~self.scene.touching(q[free], self.margin + _DISTANCE_DIP_M).any(axis=1)
        return np.asarray(q[free])

    def seem_kept(self, series: FourierSeries) -> bool:
        """Return True if a motion, within its limits of position and velocity, keeps the others at sampled rows."""
        if (series.acceleration_bound > self.room.acceleration).any():
            return False
        if not self.is_narrow:
            return True
        rows = series.sample(np.arange(_SEARCH_ROWS) * series.period / _SEARCH_ROWS)
        if self.has_torques and (np.abs(self.torque(*rows)) > _EFFORT_SHARE * self.room.effort).any():
            return False
        return self.scene is None or self.scene.keeps_apart(rows[0], self.margin + _DISTANCE_DIP_M)

    def check(self, path: FourierSeries) -> "CheckedMotion":
        """Check a motion against all limits: at every instant, torques at a thousand rows of it."""
        names, room = self.model.joint_names, self.room
        low, high, fastest = path.extremes()
        torque = None
        for what, over in (
            ("falls below its lower limit", low < room.lower),
            ("exceeds its upper limit", high > room.upper),
            ("exceeds its limit of velocity", fastest > room.velocity),
            ("exceeds its limit of acceleration", path.acceleration_bound > room.acceleration),
        ):
            if over.any():
                return CheckedMotion(f"{names[int(np.argmax(over))]} {what}", None, None)
        if self.has_torques:
            times = np.linspace(0.0, path.duration, _TORQUE_ROWS)
            torque = np.abs(self.torque(*path.sample(times))).max(axis=0) / room.effort
            if (torque > 1.0).any():
                worst = int(np.argmax(torque))
                return CheckedMotion(f"{names[worst]} needs {torque[worst]:.2f} of its torque limit", torque, None)
        if self.scene is None:
            return CheckedMotion(None, torque, None)
        clearance = self.scene.clearance(path, self.margin)
        fault = None
        if not clearance.is_kept:
            a, b = clearance.pair
            fault = (
                f"{a} and {b} come within {1000 * self.margin:g} mm: "
                f"{1000 * clearance.distance:.1f} mm at {clearance.time:.3f} s"
            )
        return CheckedMotion(fault, torque, clearance)


@dataclass(frozen=True)
class CheckedMotion:
    """Properties of a designed motion."""

    fault: str | None  # the first limit that it does not keep, in words
    torque: Floats | None  # (n,) largest share of the torque limits; None where masses or limits are unknown
    clearance: Clearance | None  # None where collisions are unchecked, or another limit is not kept


_POSE_CANDIDATES = 20  # poses to choose each static one from
_POSE_ATTEMPTS = 20  # at finding one that is free


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

    The arm touches nothing in them and can hold its weight; the paths between them are not checked.

    Args:
        limits: Robot, its limits and its free space.
        count, rng: Number of poses, and source of randomness.
    """
    model, room, g = limits.model, limits.room, limits.gravity
    base = shown_parameters(model, "static", room, g, rng)
    least = -(-base.count // model.n)
    if count < least:
        raise InputError(f"{count} poses cannot show {base.count} base parameters: expected {least} or more")
    scale, poses, information = None, [], 1e-6 * np.eye(base.count)
    for _ in range(count):
        q = free_poses(limits, rng, _POSE_CANDIDATES)
        Y = base.regressor(q, np.zeros_like(q), np.zeros_like(q), g)
        if scale is None:
            scale = np.sqrt(np.mean(Y**2, axis=(0, 1)))
            scale[scale == 0.0] = 1.0
        Y = Y / scale
        gains = np.linalg.slogdet(information + np.einsum("cab,cad->cbd", Y, Y))[1]
        best = int(np.argmax(gains))
        poses.append(q[best])
        information = information + Y[best].T @ Y[best]
    motion = np.array(poses), np.zeros((count, model.n)), np.zeros((count, model.n))
    return Excitation(
        np.arange(count, dtype=float), *motion, condition_of(base, *motion, g, limit=_MOST_CONDITION), base, "static"
    )


def shown_parameters(
    model: RobotModel, terms: Terms, room: Room, gravity: Floats, rng: np.random.Generator
) -> BaseParameters:
    """Return the base parameters that motion within the limits shows.

    Friction that needs a recording's course or torques is left out: in steady sliding it is Coulomb friction, or none.
    """
    own = model.assumed_actuation
    steady = [f.only(lambda term: not term.needs_course) for f in own.friction if not f.recording]
    model = replace(model, actuation=replace(own, friction=tuple(steady), values=None))
    low, high = room.inner()
    size = (200, model.n)
    moving = np.zeros(size), np.zeros(size)
    if terms == "full":
        moving = rng.normal(size=size), 5.0 * rng.normal(size=size)
    return base_parameters(Parameters(model, terms), gravity, (rng.uniform(low, high, size), *moving), rng)


_MOST_CONDITION = 1e6  # found: 6 to 700 within a robot's own limits, 5e4 within narrow ones, 1e17 of equal columns


def condition_of(base: BaseParameters, *motion: Floats, limit: float = np.inf) -> float:
    """Return the condition number of the regressor, columns scaled to length one.

    ExcitationError, naming columns: it is beyond `limit`.
    """
    Y = base.regressor(*motion).reshape(-1, base.count)
    R: Floats = np.linalg.qr(np.pad(Y, ((0, 0), (0, 1))), mode="r")  # type: ignore[assignment]  # R alone
    rank, condition, weakest = condition_of_triangle(R)
    if condition > limit:
        raise ExcitationError(
            f'robot "{base.parameters.model.name}": the design shows {rank} of {base.count} base parameters (condition '
            f"{condition:.3g}, expected {limit:g} at most), least of all {base.named(weakest)}: give wider limits, "
            "more poses or trials, or a longer motion",
            rank=rank,
            n_base=base.count,
        )
    return condition


_CONDITION_ROWS = 120  # of a motion whose condition is looked at
_CENTRE_POSES = 300  # drawn within the limits, from which motions take their centres
_SHRINK_FACTOR = 0.75  # what is left of a motion's amplitude where it did not keep a limit
_MAX_SHRINKS = 8  # times at most
_LIMIT_SHARE = 0.98  # of the limits of velocity and acceleration


@dataclass(frozen=True)
class _Draw:
    """What is searched: coefficients (2, harmonics, n), shares of the largest amplitude, places of the centre (n,)."""

    coefficients: Floats
    share: Floats
    place: Floats  # 0 to 1 of the room that the amplitude leaves, from its lower end

    def moved(self, step: float, rng: np.random.Generator) -> "_Draw":
        n = len(self.share)
        # of one joint, or several, or all: where something is near, few can move at a time
        moved = step * (rng.permutation(n) < rng.integers(1, n + 1))
        coefficients = self.coefficients + moved * rng.normal(size=self.coefficients.shape)
        share = np.clip(self.share + 0.3 * moved * rng.normal(size=n), 0.1, 1.0)
        return _Draw(coefficients, share, np.clip(self.place + 0.3 * moved * rng.normal(size=n), 0.0, 1.0))

    def motion(self, period: float, room: Room) -> FourierSeries:
        """Return the motion whose joints go over their share of what room and velocity allow."""
        unit, largest, reach, middle = self._unit(period, room)
        low, high = room.inner()
        amplitude = self.share * largest
        left = (high - low) - amplitude * reach
        centre = low + 0.5 * amplitude * reach + self.place * left - amplitude * middle
        return FourierSeries(unit.a * amplitude, unit.b * amplitude, centre, period)

    def shrunk(self, centre: Floats, period: float, limits: MotionLimits) -> "_Draw | None":
        """Return the draw about a centre, its amplitudes shrunk until it keeps all limits; None at a tenth of them."""
        _, largest, reach, _ = self._unit(period, limits.room)
        low, high = limits.room.inner()
        share = self.share
        for _ in range(_MAX_SHRINKS):
            span = share * largest * reach
            left = np.maximum((high - low) - span, 1e-12)
            draw = _Draw(self.coefficients, share, np.clip((centre - 0.5 * span - low) / left, 0.0, 1.0))
            if limits.seem_kept(draw.motion(period, limits.room)):
                return draw
            share = share * _SHRINK_FACTOR
        return None

    def _unit(self, period: float, room: Room) -> tuple[FourierSeries, Floats, Floats, Floats]:
        """Return the unscaled motion, the largest amplitudes (n,) within limits, what it reaches over, its middle."""
        unit = series_at_rest(self.coefficients, period)
        q, qd, _ = unit.sample(unit.grid())
        reach = np.ptp(q, axis=0) * 1.01  # between two instants of the grid it reaches less than a per cent further
        low, high = room.inner()
        allowed = np.minimum((high - low) / reach, _LIMIT_SHARE * room.velocity / np.abs(qd).max(axis=0))
        largest = np.asarray(np.minimum(allowed, _LIMIT_SHARE * room.acceleration / unit.acceleration_bound))
        return unit, largest, reach, 0.5 * (q.max(axis=0) + q.min(axis=0))


def fourier_motion(
    limits: MotionLimits,
    rng: np.random.Generator,
    *,
    period: float = 10.0,
    harmonics: int = 5,
    rate: float = 200.0,
    trials: int = 300,
) -> Excitation:
    """Design one period of a Fourier motion that excites the full dynamics, from rest to rest, within all limits.

    The best of random trials: coefficients, the share of each joint's range that its velocity limit allows, the
    place of its centre; a third of them anywhere, shrunk until they keep torques, accelerations and distances, the
    others around the best so far. The best is checked at every instant; where it fails, the one before it is taken.

    Args:
        limits: Robot, its limits and its free space.
        rng: Source of randomness.
        period, rate: Period [s], and rows per second [Hz].
        harmonics, trials: Number of harmonics, three or more, and of trials.
    """
    if not (period > 0.0 and rate > 0.0 and trials >= 1 and harmonics >= 3 and period * rate >= 2 * _CONDITION_ROWS):
        raise InputError(
            f"fourier: expected a period and a rate of {2 * _CONDITION_ROWS} rows at least, three or more harmonics "
            f"and one or more trials; got {period:g} s, {rate:g} Hz, {harmonics} harmonics, {trials} trials"
        )
    n, base = limits.model.n, shown_parameters(limits.model, "full", limits.room, limits.gravity, rng)
    centres = free_poses(limits, rng, _CENTRE_POSES) if limits.is_narrow else None
    times = np.arange(_CONDITION_ROWS) * period / _CONDITION_ROWS
    best: list[tuple[float, _Draw]] = []  # that seemed to keep all limits, each better than the one before it

    def condition(draw: _Draw) -> float:
        return condition_of(base, *draw.motion(period, limits.room).sample(times), limits.gravity)

    for trial in range(trials):
        draw: _Draw | None
        if best and trial >= trials // 3:
            draw = best[-1][1].moved(0.5 * (1.0 - trial / trials) + 0.05, rng)
        else:
            draw = _Draw(rng.normal(size=(2, harmonics, n)), rng.uniform(0.6, 1.0, n), np.full(n, 0.5))
            if centres is not None:  # what shows less at its full size is not worth shrinking
                worth = not best or condition(draw) <= best[-1][0]
                draw = draw.shrunk(centres[rng.integers(len(centres))], period, limits) if worth else None
        shows = np.inf if draw is None else condition(draw)
        if draw is None or (best and shows >= best[-1][0]):
            continue
        if limits.seem_kept(draw.motion(period, limits.room)):
            best.append((shows, draw))
    fault: str | None = "no motion that was tried keeps all limits"
    for _, draw in reversed(best):
        series = draw.motion(period, limits.room)
        checked = limits.check(series)
        if (fault := checked.fault) is None:
            break
    else:
        raise LimitError(
            f'robot "{limits.model.name}": no motion found that keeps all limits: {fault}; more trials, a longer '
            "period or a smaller margin may find one"
        )
    time = np.arange(round(period * rate) + 1) / rate
    q, qd, qdd = series.sample(time)
    shown = condition_of(base, q, qd, qdd, limits.gravity, limit=_MOST_CONDITION)
    return Excitation(time, q, qd, qdd, shown, base, "full", series, checked)


def free_poses(limits: MotionLimits, rng: np.random.Generator, count: int) -> Floats:
    """Return those of `count` poses drawn within the limits that can be rested in, (M, n), one or more."""
    size = (count, limits.model.n)
    if not limits.is_narrow:
        return rng.uniform(*limits.room.inner(), size)
    for _ in range(_POSE_ATTEMPTS):
        drawn = rng.uniform(*limits.room.inner(), size)
        if len(free := limits.free_poses(drawn)):
            return free
    why = "its own weight cannot be held"
    if (scene := limits.scene) is not None:
        close = scene.touching(drawn, limits.margin + _DISTANCE_DIP_M)
        often = [int(k) for k in np.argsort(-close.sum(axis=0), kind="stable")[:3]]
        pairs = (f"{' and '.join(scene.names(k))} in {100 * close[:, k].mean():.0f} %" for k in often)
        why += f", or its bodies come within {1000 * limits.margin:g} mm of their surroundings: {', '.join(pairs)}"
    raise InputError(
        f'robot "{limits.model.name}": none of {_POSE_ATTEMPTS * count} poses within the limits is free: {why}'
    )
