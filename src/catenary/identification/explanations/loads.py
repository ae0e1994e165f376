"""How likely and how heavy a load is on a link, averaged over what else may differ from the arm that is known.

What else may differ, a gain of one joint's torque or of all, a tilt of the base, zeros of torque, friction, looks like
a load to an arm that hardly moves. So each of these is supposed beside the load, one kind at a time, and without a load
as well: the result is the mean over all, by how likely they are [Hoeting, Madigan, Raftery, Volinsky 1999, Bayesian
model averaging: a tutorial]. All kinds at once would widen the interval for nothing.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.gravity.load_location import load_of_any_size, mixed
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
    columns: Callable[[Evidence, Floats], list[Extra]]  # from a recording and the parameters that explain it


def _gain(evidence: Evidence, beta: Floats) -> list[Extra]:
    return [Extra(evidence.columns(evidence.plain)[0] @ beta, 0.0, _GAIN_STD)]


def _gain_of(evidence: Evidence, beta: Floats, joint: int) -> list[Extra]:
    return _alone(evidence.columns(evidence.plain)[0] @ beta, [joint], _GAIN_STD)


def _zeros(evidence: Evidence, beta: Floats, joints: Sequence[int]) -> list[Extra]:
    return _alone(np.broadcast_to(evidence.rows.size, evidence.rows.known.shape), joints, _ZERO_SHARE)


def _friction(evidence: Evidence, beta: Floats) -> list[Extra]:
    L, terms = evidence.shown, evidence.rows.parameters.actuation
    rubs = [L + k for k, term in enumerate(terms) if term.friction is not None and not term.friction.at_rest]
    torque = evidence.columns(evidence.plain)[0][:, :, rubs] @ beta[rubs]
    return _alone(torque, np.flatnonzero(torque.any(axis=0)).tolist(), _FRICTION_STD)


def _tilt(evidence: Evidence, beta: Floats) -> list[Extra]:
    """Return the change of torques by turning the base by a radian, about two level axes."""
    plain, down = evidence.plain, np.array(evidence.rows.samples.gravity)
    if down.ndim == 2 or not down.any():
        return []
    across, own = np.linalg.svd(down[None])[2][1:] * np.linalg.norm(down), evidence.columns(plain)[0]
    tilted = (evidence.columns(replace(plain, gravity=tuple(down + way)))[0] for way in across)
    return [Extra((columns - own) @ beta, 0.0, _TILT_STD_RAD) for columns in tilted]


def _alone(torque: Floats, joints: Sequence[int], std: float) -> list[Extra]:
    own = np.eye(torque.shape[1])
    return [Extra(torque * own[j], 0.0, std) for j in joints]


def differences(names: Sequence[str]) -> tuple[Difference, ...]:
    """Return the differences that are weighed, none first."""
    of_joint, every = float(np.log(len(names))), range(len(names))
    return (
        Difference("", 0.0, lambda evidence, beta: []),
        Difference("all torques times a gain", 0.0, _gain),
        Difference("a tilt of the base", 0.0, _tilt),
        Difference("friction", 0.0, _friction),
        Difference("zeros of torque", 0.0, partial(_zeros, joints=every)),
        *(Difference(f"{names[j]}'s torque times a gain", of_joint, partial(_gain_of, joint=j)) for j in every),
        *(Difference(f"{names[j]}'s zero of torque", of_joint, partial(_zeros, joints=[j])) for j in every),
    )


class Load(NamedTuple):
    """A load on a link, over all differences."""

    link: int
    prior: Floats  # (10, m) of its parameters beforehand, see `Belief.carrying`
    logs: Floats  # (d,) log evidence with each difference
    without: Floats  # the same without a load
    mean: Floats  # (10,) of its parameters
    covariance: Floats
    place: int = 0  # which of several places it was supposed on
    share: float = 1.0  # probability that it is there, if there is a load


class Loads(NamedTuple):
    """Loads on several links, each of which may carry the one that there is."""

    each: tuple[Load, ...]  # likeliest first
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
        start = loaded[0].belief
        # without recordings of the day nothing but the load tells links apart
        bare = None if unloaded else [_chain(loaded, start, kind)[0] for kind in others]
        loads = [_weighed(loaded, unloaded, others, bare, *place) for place in places]
    evidence = np.array([np.logaddexp.reduce(load.logs) for load in loads]) - _LOAD_PRICE
    nothing = np.logaddexp.reduce([np.logaddexp.reduce(load.without) for load in loads])
    some = np.logaddexp.reduce(evidence)
    shares = np.exp(evidence - some).tolist()
    each = [load._replace(place=k, share=share) for k, (load, share) in enumerate(zip(loads, shares, strict=True))]
    each.sort(key=lambda load: -load.share)
    return Loads(tuple(each), float(np.exp(some - np.logaddexp(some, nothing))))


def _weighed(
    loaded: Sequence[Evidence],
    unloaded: Sequence[Evidence],
    others: Sequence[Difference],
    bare: Sequence[float] | None,
    link: int,
    place: Floats | None,
) -> Load:
    """Weigh a load on a link, beside everything that may differ; `bare` is the log evidence of none, if known."""
    start = loaded[0].belief
    load = start.load if place is None else start.load_mass * point_mass(place)[:, None]
    with_load, without, bare_load = np.zeros((3, len(others)))
    shown, bodies = list[tuple[Floats, Floats]](), list[tuple[Floats, Floats]]()
    for k, kind in enumerate(others):
        before, day = -kind.price, start
        if unloaded:
            value, _, day = _chain(unloaded, start.carrying(link, load), kind)
            before += value
        carrying = day.carrying(link, load)
        without[k] = before + (_chain(loaded, day, kind)[0] if bare is None else bare[k])
        some, fit, _ = _chain(loaded, carrying, kind)
        u, covariance = loaded[0].believing(carrying).body(link, load, fit)
        precision = np.linalg.inv(covariance)
        shown.append((precision - np.eye(len(u)), precision @ u))
        as_large = 0.5 * float(u @ precision @ u) - 0.5 * float(np.linalg.slogdet(precision)[1])
        weighed, mean, spread = load_of_any_size(*shown[k])
        bodies.append((load @ mean, load @ spread @ load.T))
        bare_load[k] = before + some - as_large
        with_load[k] = bare_load[k] + weighed
    if place is None:  # any body, or one that is small beside its distance, each as likely
        with_load -= np.log(2.0)
        reach = start.reaches[start.links.index(link)]
        for k in map(int, np.flatnonzero(with_load > with_load.max() - _WEIGHED_NATS)):
            value, *point = _point(load, *shown[k], reach)
            logs = np.array([with_load[k], bare_load[k] + value - np.log(2.0)])
            with_load[k] = np.logaddexp.reduce(logs)
            means, covariances = (np.array(pair) for pair in zip(bodies[k], point, strict=True))
            bodies[k] = mixed(np.exp(logs - with_load[k]), means, covariances)
    share = np.exp(with_load - np.logaddexp.reduce(with_load))
    means, covariances = (np.array(values) for values in zip(*bodies, strict=True))
    return Load(link, load, with_load, without, *mixed(share, means, covariances))


def _point(load: Floats, information: Floats, score: Floats, reach: float) -> tuple[float, Floats, Floats]:
    """Return the log evidence ratio of a point mass against no load, and the point mass's parameters.

    information (10, 10) and score (10,) are of a free body's numbers, load (10, 10) diagonal times them its parameters.
    Beforehand the logarithm of the mass is uniform, the place normal with a deviation of the reach [m]; integrated by
    Laplace's method.
    """
    from scipy.optimize import least_squares

    sizes, (values, vectors) = np.diag(load), np.linalg.eigh(information)
    shown = values > 1e-9 * values[-1]
    R = np.sqrt(values[shown])[:, None] * vectors[:, shown].T  # of the recordings' own likelihood of the numbers
    z = (vectors[:, shown].T @ score) / np.sqrt(values[shown])
    u = np.linalg.solve(information + np.eye(len(score)), score)
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
    return point, body(best.x), ways @ np.linalg.solve(H, ways.T)


def _chain(recordings: Sequence[Evidence], belief: Belief, kind: Difference) -> tuple[float, Fit, Belief]:
    """Return the log evidence of recordings one after the other, the last fit, and what is believed of the arm then."""
    total = 0.0
    for recording in recordings:
        evidence = recording.believing(belief)
        extra = kind.columns(evidence, evidence.fit(evidence.plain, 0).beta)
        fit = evidence.fit(evidence.plain, 0, extra)
        total += fit.log_evidence
        belief = posterior(evidence, fit)
    return total, fit, belief
