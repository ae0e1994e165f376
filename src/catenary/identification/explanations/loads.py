"""How likely and how heavy a load is on a link, averaged over what else may differ from the arm that is known.

What else may differ, a gain of one joint's torque or of all, a tilt of the base, zeros of torque, friction, looks like
a load to an arm that hardly moves. So each of these is supposed beside the load, one kind at a time, and without a load
as well: the result is the mean over all, by how likely they are [Hoeting, Madigan, Raftery, Volinsky 1999, Bayesian
model averaging: a tutorial]. All kinds at once would widen the interval for nothing.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.gravity.load_location import load_of_any_size, log_evidence, mixed
from catenary.identification.explanations.evidence import Evidence, Extra, Fit
from catenary.identification.explanations.findings import posterior
from catenary.identification.explanations.priors import Belief

_LOAD_PRICE = 1.0  # [nats] negative log prior odds of a load
_GAIN_STD, _TILT_STD_RAD, _FRICTION_STD = 0.05, np.deg2rad(2.5), 0.3
_POINT_MASSES, _POINT_STARTS = (1.0 / 64.0, 2.0), 4  # of a load's deviation: the least and largest that is tried
_POINT_STEPS, _WEIGHED_NATS = 20, 7.0  # of one start; below the likeliest difference that is weighed as point mass
_ZERO_SHARE = 1.0  # standard deviation of a zero, of its joint's torque


def point_mass(position: Floats) -> Floats:
    """Return the ten parameters (m, m c, I about the origin) of 1 kg at a place (3,) [m]."""
    tensor = position @ position * np.eye(3) - np.outer(position, position)
    return np.concatenate([[1.0], position, tensor[np.triu_indices(3)]])


class Difference(NamedTuple):
    """A kind of difference between an arm as it was identified and as it was recorded."""

    says: str
    price: float  # [nats]
    columns: Callable[["Recording", Floats], list[Extra]]  # from a recording and the parameters that explain it


class Recording:
    """One recording of the arm."""

    def __init__(self, evidence: Evidence) -> None:
        self.evidence, samples = evidence, evidence.rows.samples
        rows, plain = evidence.rows, evidence.plain
        self.X = evidence.columns(plain)[0]
        self.turned = list[Floats]()  # (N, n, r) change of the links' columns by a radian, about two level axes
        down = np.array(samples.gravity, dtype=float)
        if down.ndim == 1 and down.any():
            across = np.linalg.svd(down[None])[2][1:] * np.linalg.norm(down)
            own = rows.links(plain)
            tilted = (rows.links(replace(plain, gravity=tuple(down + way))) for way in across)
            self.turned = [(columns - own) @ rows.shown for columns in tilted]

    def gain(self, beta: Floats, joint: int | None = None) -> list[Extra]:
        """Return the torques of parameters, of one joint or of all."""
        torque = self.X @ beta
        return [Extra(torque, 0.0, _GAIN_STD) if joint is None else _alone(torque, joint, _GAIN_STD)]

    def zeros(self, beta: Floats, joints: Sequence[int]) -> list[Extra]:
        """Return constant torques of joints."""
        size = self.evidence.rows.size
        return [_alone(np.ones(self.X.shape[:2]), j, _ZERO_SHARE * size[j]) for j in joints]

    def friction(self, beta: Floats) -> list[Extra]:
        """Return friction of every joint."""
        L, terms = self.evidence.shown, self.evidence.rows.parameters.actuation
        rubs = [L + k for k, term in enumerate(terms) if term.friction is not None and not term.friction.at_rest]
        torque = self.X[:, :, rubs] @ beta[rubs]
        return [_alone(torque, j, _FRICTION_STD) for j in range(torque.shape[1]) if torque[:, j].any()]

    def tilt(self, beta: Floats) -> list[Extra]:
        """Return the change of torques by turning the base, about two axes."""
        return [Extra(dX @ beta[: self.evidence.shown], 0.0, _TILT_STD_RAD) for dX in self.turned]


def _alone(torque: Floats, joint: int, std: float) -> Extra:
    return Extra(np.where(np.arange(torque.shape[1]) == joint, torque, 0.0), 0.0, std)


def differences(names: Sequence[str]) -> Iterator[Difference]:
    """Yield what may differ, nothing first."""
    of_joint = float(np.log(len(names)))
    yield Difference("", 0.0, lambda recording, beta: [])
    yield Difference("all torques times a gain", 0.0, Recording.gain)
    yield Difference("a tilt of the base", 0.0, Recording.tilt)
    yield Difference("friction", 0.0, Recording.friction)
    yield Difference("zeros of torque", 0.0, partial(Recording.zeros, joints=range(len(names))))
    for j, name in enumerate(names):
        yield Difference(f"{name}'s torque times a gain", of_joint, partial(Recording.gain, joint=j))
        yield Difference(f"{name}'s zero of torque", of_joint, partial(Recording.zeros, joints=(j,)))


class Load(NamedTuple):
    """A load on a link, over all differences."""

    link: int
    prior: Floats  # (10, m) of its parameters beforehand, see `Belief.carrying`
    logs: Floats  # (d,) log evidence with each difference
    without: Floats  # the same without a load
    mean: Floats  # (10,) of its parameters
    covariance: Floats


class Loads(NamedTuple):
    """Loads on several links, each of which may carry the one that there is."""

    each: tuple[Load, ...]  # likeliest first
    shares: tuple[float, ...]  # probability of each, if there is a load
    order: tuple[int, ...]  # which of the places each is on
    sure: float  # probability that there is one

    @property
    def gain(self) -> float:
        """The log evidence of the likeliest link's load over nothing, if nothing else differs."""
        first = self.each[0]
        return float(first.logs[0] - first.without[0]) - _LOAD_PRICE


def weigh_loads(
    loaded: Sequence[Evidence],
    places: Sequence[tuple[int, Floats | None]],
    others: Sequence[Difference],
    *,
    unloaded: Sequence[Evidence] = (),
) -> Loads:
    """Weigh a load on each of several links: a point mass at its place [m], or any body where that is None.

    Args:
        loaded: Recordings of an arm that carries it or not, under what was believed of the arm before.
        places: Links, as of the robot's tree, and places in their frames.
        others: What else may differ, nothing first.
        unloaded: Recordings of the same day without it.
    """
    with threadpool_limits(limits=1):  # matrices are small: BLAS threads would only wait for each other
        recordings, empty = ([Recording(part) for part in parts] for parts in (loaded, unloaded))
        start = loaded[0].belief
        # without recordings of the day nothing but the load tells links apart
        bare = None if empty else [_chain(recordings, start, kind)[0] for kind in others]
        loads = [_weighed(recordings, empty, others, bare, *place) for place in places]
    evidence = np.array([np.logaddexp.reduce(load.logs) for load in loads]) - _LOAD_PRICE
    nothing = float(np.logaddexp.reduce([np.logaddexp.reduce(load.without) for load in loads]))
    some = float(np.logaddexp.reduce(evidence))
    shares = np.exp(evidence - some)
    order = sorted(range(len(loads)), key=lambda k: -shares[k])
    sure = float(np.exp(some - np.logaddexp(some, nothing)))
    return Loads(tuple(loads[k] for k in order), tuple(float(shares[k]) for k in order), tuple(order), sure)


def _weighed(
    loaded: Sequence[Recording],
    unloaded: Sequence[Recording],
    others: Sequence[Difference],
    bare: Sequence[float] | None,
    link: int,
    place: Floats | None,
) -> Load:
    """Weigh a load on a link, beside everything that may differ; `bare` is the log evidence of none, if known."""
    start = loaded[0].evidence.belief
    load = start.load if place is None else start.load_mass * point_mass(place)[:, None]
    reach = start.reaches[start.links.index(link)]
    with_load, without, of_sizes = np.zeros((3, len(others)))
    free, bodies = list[tuple[Floats, Floats]](), list[tuple[Floats, Floats]]()
    for k, kind in enumerate(others):
        before, day = 0.0, start
        if unloaded:
            before, _, day = _chain(unloaded, start.carrying(link, load), kind)
        carrying = day.carrying(link, load)
        none = _chain(loaded, day, kind)[0] if bare is None else bare[k]
        some, fit, _ = _chain(loaded, carrying, kind)
        u, covariance = loaded[0].evidence.believing(carrying).body(link, load, fit)
        of_sizes[k], mean, spread = load_of_any_size(u, covariance)
        free.append((u, covariance))
        bodies.append((load @ mean, load @ spread @ load.T))
        with_load[k], without[k] = before + some + of_sizes[k] - kind.price, before + none - kind.price
    if place is None:  # any body, or one that is small beside its distance, each as likely
        with_load -= np.log(2.0)
        for k in map(int, np.flatnonzero(with_load > with_load.max() - _WEIGHED_NATS)):
            value, *point = _point(load, *free[k], reach)
            value += with_load[k] - of_sizes[k]
            either = np.logaddexp(with_load[k], value)
            means, covariances = (np.array(pair) for pair in zip(bodies[k], point, strict=True))
            bodies[k] = mixed(np.exp(np.array([with_load[k], value]) - either), means, covariances)
            with_load[k] = either
    share = np.exp(with_load - np.logaddexp.reduce(with_load))
    means, covariances = (np.array(values) for values in zip(*bodies, strict=True))
    return Load(link, load, with_load, without, *mixed(share, means, covariances))


def _point(load: Floats, u: Floats, covariance: Floats, reach: float) -> tuple[float, Floats, Floats]:
    """Return the log evidence ratio of a point mass against a free body, and the point mass's parameters.

    u (10,) are the numbers of the free body, load (10, 10) diagonal times them its parameters. Beforehand the logarithm
    of the mass is uniform, the place normal with a deviation of the reach [m]; integrated by Laplace's method.
    """
    from scipy.optimize import least_squares

    sizes, precision = np.diag(load), np.linalg.inv(covariance)
    values, vectors = np.linalg.eigh(precision - np.eye(len(u)))
    shown = values > 1e-9 * values[-1]
    R = np.sqrt(values[shown])[:, None] * vectors[:, shown].T  # of the recordings' own likelihood of u
    z = (vectors[:, shown].T @ precision @ u) / np.sqrt(values[shown])
    low, high = (float(np.log(times * sizes[0])) for times in _POINT_MASSES)

    def body(x: Floats) -> Floats:
        return float(np.exp(x[0])) * point_mass(reach * x[1:])

    def misfit(x: Floats) -> Floats:
        return np.concatenate([np.dot(R, body(x) / sizes) - z, x[1:]])

    solutions, bounds = [], ([low, *[-np.inf] * 3], [high, *[np.inf] * 3])
    for log_mass in np.linspace(low + 1e-6, high - 1e-6, _POINT_STARTS):
        place = np.clip(sizes[1:4] * u[1:4] / np.exp(log_mass) / reach, -2.0, 2.0)
        solutions.append(least_squares(misfit, [log_mass, *place], bounds=bounds, max_nfev=_POINT_STEPS))
    best = min(solutions, key=lambda each: float(each.cost))
    jac = np.asarray(best.jac)
    H = jac.T @ jac + np.diag([12.0 / (high - low) ** 2, 0.0, 0.0, 0.0])
    ways = np.column_stack([(body(best.x + step) - body(best.x - step)) / 2e-5 for step in 1e-5 * np.eye(4)])
    point = -float(best.cost) + 0.5 * float(z @ z) - 0.5 * float(np.linalg.slogdet(H)[1])
    point += 0.5 * float(np.log(2.0 * np.pi)) - float(np.log(high - low))
    as_free = float(log_evidence((precision - np.eye(len(u)))[None], (precision @ u)[None])[0])
    return point - as_free, body(best.x), ways @ np.linalg.solve(H, ways.T)


def _chain(recordings: Sequence[Recording], belief: Belief, kind: Difference) -> tuple[float, Fit, Belief]:
    """Return the log evidence of recordings one after the other, the last fit, and what is believed of the arm then."""
    total = 0.0
    for of in recordings:
        evidence = of.evidence.believing(belief)
        extra = kind.columns(of, evidence.fit(evidence.plain, 0).beta)
        fit = evidence.fit(evidence.plain, 0, extra)
        total += fit.log_evidence
        belief = posterior(evidence, fit)
    return total, fit, belief
