"""What an arm carries beyond what it was identified with: how much, where, on which link.

Several links may explain the torques as well: then they share the probability, by the likelihood of what each leaves
(gravity/load_location.py weighs poses at rest of a known arm), and none is named alone.

A torque sensor's zero shifts between days, and a constant torque looks like a load to an arm that hardly moves. So each
recording has a zero of its own on each joint, z ~ N(0, s^2) with s the RMS of that joint's torque, which is integrated
out: with rows in units of their noise, of which N count as independent, y - a mean(y) with (1 - a)^2 = 1 / (1 + N s^2)
has white noise again. Where poses do not separate zero and load, s widens the load's interval.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import erf, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.load_location import JOINT_STEPS, likely, location_text, probabilities, telling_joint
from catenary.identification.identification import Identification
from catenary.identification.identify_options import filter_of
from catenary.identification.least_squares import one_over, scaled_solution
from catenary.identification.residuals import rms
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.units import TORQUE_UNIT
from catenary.verdict.finding import Finding

_SIGNIFICANT_DEVIATIONS = 3.0  # standard deviations of the estimate
_TORQUE_SHARE = 0.2  # of the payload, over what stays unexplained: less is seen in unloaded recordings of other days
_TORQUE_SHARE_ANYWHERE = 0.4  # the same where mass, place and link are free to follow a drift of the arm
_CORRELATED_S = 1.0  # [s] over which residuals hang together: friction and cables remember
_TOLD_DEVIATION = 0.3  # of a mass: a larger standard deviation, and the recordings do not tell it
_SMALL_MASS_PENALTY = 3e-3  # of the residual per kg: where a place near an axis hides any mass, the smallest is taken
_HIDDEN_DEVIATION = 100.0  # [kg, kg m] standard deviation of what recordings do not show at all
_ZERO_SHIFT_LOG_ODDS = 3.0  # logarithm of how much less likely beforehand it is, of each zero, that it shifted
_SHIFTED_RMS = 0.5  # of the RMS that identification leaves of an axis: a zero that differs by less is none that shifted
_VISIBLE_RATIO = 0.02  # smallest singular value, columns scaled to one, of a direction that recordings show


@dataclass(frozen=True)
class PayloadEstimate:
    """A point mass on a link; `mass` or `moment` is None where the recordings cannot tell it."""

    link: str
    mass: float | None  # [kg]
    mass_std: float | None
    moment: Floats | None  # (3,) mass times position [kg m], in the link's frame; NaN where it does not show
    moment_std: Floats | None
    detected: bool
    confidence: float  # that the torques are not those of the unloaded arm, 0 to 1
    explained: float  # share of the mean square residual that the payload takes away
    probability: float = 1.0  # that it is on this link, if there is one; 1 where its place was given
    likely: tuple[str, ...] = ()  # the fewest links that hold 95 % of that, likeliest first
    telling_joint: str | None = None  # whose motion would tell between the first two, where these recordings do not
    zeros: Floats | None = None  # (r, n) of torque, by recording, less those identified [Nm or N]
    zeros_std: Floats | None = None
    like_zeros: bool = False  # something is there, and zeros that shifted would look the same

    @property
    def location(self) -> str:
        """Say on which link it is, or between which ones the recordings cannot tell."""
        return location_text(self.likely or (self.link,), self.telling_joint)


def estimate_payload(
    result: Identification,
    loaded: Sequence[Samples],
    *,
    at: tuple[str, ArrayLike] | None = None,
    unloaded: Sequence[Samples] = (),
) -> PayloadEstimate:
    """Find a payload in recordings of a robot whose dynamics were identified without it.

    What torques are left, weighted by the training residual of each axis, is fitted by the torques of a point mass and
    a zero of each joint's torque.
    At a known place its mass alone is fitted. Otherwise mass and place are fitted on every link, and the likeliest
    link is taken; `likely` and `location` say which others the recordings cannot tell from it.

    Residuals of a real arm repeat with its motion, so the standard deviation counts rows as independent only beyond a
    second, and periods of the excitation once. "No payload" is said of an estimate below three standard deviations,
    or whose torque is less than a fifth of what stays unexplained (two fifths where its place was not given).

    Limitation: the identified parameters are taken for exact, their uncertainty is not in the probabilities. With
    joints that hardly move a wrong link may be named with high probability.

    Args:
        result: The identified dynamics.
        loaded: Recordings with the payload, prepared as those that were fitted.
        at: Frame, and the payload's place in it [m], if known.
        unloaded: Recordings without it, of the same day: what they show in its place is subtracted.

    Raises:
        InputError: No recording, an unknown frame or one at rest, or a model of poses at rest and a moving recording.
    """
    if not loaded:
        raise InputError("payload: expected at least one recording")
    if at is not None:
        link, place = place_of(result, at)
        return _fit(result, loaded, unloaded, link, place)[0]
    return payload_candidates(result, loaded, unloaded=unloaded)[0]


def payload_candidates(
    result: Identification, loaded: Sequence[Samples], *, unloaded: Sequence[Samples] = ()
) -> tuple[PayloadEstimate, ...]:
    """Estimate the payload on every link, with the probability that it is there; the likeliest link first."""
    fits = [_fit(result, loaded, unloaded, link, None) for link in result.base.parameters.links]
    rows, n = sum(len(part.q) for part in loaded), result.model.n
    found, misfits, bodies, shifted = zip(*fits, strict=True)
    best = min(misfits)
    # residuals are weighted by those of the training; where even the best link leaves more, that is the noise
    repeated = _lags(result, rows, _rate(result, loaded)) * _repeats(result, rows)
    counted = 1.0 / repeated / max(1.0, best / (rows * n))
    # every link has the same four unknowns, so that what each leaves decides, and how many zeros must have shifted
    each = zip(misfits, shifted, strict=True)
    shares = probabilities([-0.5 * counted * (misfit - best) - _ZERO_SHIFT_LOG_ODDS * count for misfit, count in each])
    order = sorted(range(len(fits)), key=lambda k: (-shares[k], -found[k].explained))
    links = likely([found[k].link for k in order], [shares[k] for k in order])
    joint = None
    if len(links) > 1:
        pair = [(found[k].link, bodies[k]) for k in order[:2]]
        joint = telling_joint(
            compact_regressor(result.model), pair, loaded[0].q[-1], result.gravity, result.usual + 1e-9
        )
    return tuple(replace(found[k], probability=shares[k], likely=links, telling_joint=joint) for k in order)


def zero_findings(
    result: Identification, loaded: Sequence[Samples], payload: PayloadEstimate
) -> list[tuple[str, Finding]]:
    """Name zeros of torque that differ from those identified, and a load that zeros which shifted would look like."""
    if payload.zeros is None or payload.zeros_std is None:
        return []
    model, found = result.model, list[tuple[str, Finding]]()
    usual = 1.0 / one_over(result.usual)
    for part, zeros, deviations in zip(loaded, payload.zeros, payload.zeros_std, strict=True):
        shifted = np.flatnonzero(_shifted(zeros / usual, deviations / usual))
        told = ", ".join(
            f"{model.joint_names[i]} {zeros[i]:+.3g} ({deviations[i]:.2g}) {TORQUE_UNIT[model.joint_units[i]]}"
            for i in shifted
        )
        if told:
            says = f"zeros of torque differ from those identified, standard deviation: {told}; taken out of the load"
            joints = tuple(model.joint_names[i] for i in shifted)
            found.append((part.name, Finding("offset", joints, says, "a sensor's zero that shifted", refuses=False)))
    if payload.like_zeros:
        joint = _separating_joint(result, loaded[0].q[-1], payload)
        move = f"move {joint}" if joint else "no joint would, moved by itself"
        says = f"a load on {payload.link} cannot be told from zeros of torque that shifted: {move}"
        found.append((loaded[0].name, Finding("offset", (), says, "poses that are too much alike", refuses=False)))
    return found


def _shifted(zeros: Floats, deviations: Floats) -> NDArray[np.bool_]:
    """Return which zeros, in units of what identification leaves of an axis, are surely not those identified."""
    return np.asarray(np.abs(zeros) > np.maximum(_SIGNIFICANT_DEVIATIONS * deviations, _SHIFTED_RMS))


def _separating_joint(result: Identification, q: Floats, payload: PayloadEstimate) -> str | None:
    """Return the joint whose motion from q (n,) changes a load's torque most beside the usual residual; or None."""
    model = result.model
    body = np.array([payload.mass or 1.0, *np.nan_to_num(np.zeros(3) if payload.moment is None else payload.moment)])
    own = slice(PER_LINK * model.link_names.index(payload.link), None)
    steps = np.array([0.0, *JOINT_STEPS])
    changes = []
    for joint, unit in enumerate(model.joint_units):
        poses = np.tile(q, (len(steps), 1))
        poses[:, joint] += steps * (1.0 if unit == "rad" else 0.2)
        poses = np.clip(poses, model.lower, model.upper)
        still = np.zeros_like(poses)
        torque = torque_regressor(model, poses, still, still, result.gravity)[:, :, own][:, :, :4] @ body
        changes.append(float(np.abs((torque - torque[0]) / (result.usual + 1e-9)).max()))
    best = int(np.argmax(changes))
    return model.joint_names[best] if changes[best] > _SIGNIFICANT_DEVIATIONS else None


def _rate(result: Identification, samples: Sequence[Samples]) -> float:
    """Return the rows per second of recordings; poses at rest have no time, and count one by one."""
    return 1.0 if result.options.terms == "static" else 1.0 / float(np.median(np.diff(samples[0].time)))


def _reach(model: RobotModel) -> float:
    """Return how far a load can be from its link's origin [m] at most: the arm stretched, and half a metre."""
    slides = model.tree.prismatic @ np.abs(model.coupling)
    travel = np.maximum(np.abs(model.lower), np.abs(model.upper))
    stretched = np.linalg.norm(model.tree.origin, axis=1).sum()
    return float(stretched + np.sum(slides * np.where(np.isfinite(travel), travel, 0.0)) + 0.5)


def point_mass(position: Floats) -> Floats:
    """Return the ten parameters (m, m c, I about the origin) of 1 kg at a place (3,) [m]."""
    tensor = position @ position * np.eye(3) - np.outer(position, position)
    return np.concatenate([[1.0], position, tensor[np.triu_indices(3)]])


def place_of(result: Identification, at: tuple[str, ArrayLike]) -> tuple[int, Floats]:
    """Return the link that a frame is on, and a place in it (3,) in the link's frame [m]."""
    frame = result.model.frame(at[0])
    position = as_array("payload position", at[1], (3,))
    if frame.link < 0:
        raise InputError(f'payload: frame "{at[0]}" does not move: what hangs there loads no joint')
    return frame.link, frame.pose.rotation @ position + frame.pose.position


class _Equations(NamedTuple):
    """Torques of recordings in units of the training residual, their zeros integrated out, and what that takes."""

    Y: Floats  # (N, n, 10) per parameter of a body on a link
    y: Floats  # (N, n) that identification leaves
    means: list[tuple[Floats, Floats]]  # of each recording, before: (n, 10), (n,)
    places: list[slice]  # of each recording's rows
    zeros: Floats  # (r, n) deviation of zeros, beforehand
    independent: Floats  # (r,) rows that count as independent
    weights: Floats  # (n,) [1/Nm or 1/N]


def _fit(
    result: Identification, loaded: Sequence[Samples], unloaded: Sequence[Samples], link: int, place: Floats | None
) -> tuple[PayloadEstimate, float, Floats, int]:
    """Fit a payload on a link, at a place if that is known.

    Return it; the weighted sum of squares that stays; mass and moment (4,) [kg, kg m], also where recordings hardly
    tell them; how many zeros differ from those identified.
    """
    name = result.model.link_names[link]
    rows = _rows(result, loaded, link)
    Y, y = rows.Y, rows.y
    baseline = np.zeros(PER_LINK)
    if unloaded:
        before = _rows(result, unloaded, link)
        directions = np.eye(PER_LINK) if place is None else point_mass(place)[:, None]
        baseline = directions @ scaled_solution(_flat(before.Y @ directions), before.y.reshape(-1), _VISIBLE_RATIO)
        y = y - Y @ baseline
    if not np.abs(Y).max() > 0.0:
        nothing = PayloadEstimate(name, None, None, None, None, False, 0.0, 0.0)
        return nothing, float(np.sum(y**2)), np.zeros(4), 0
    if place is not None:
        column = point_mass(place)
        mass = float(scaled_solution(_flat(Y @ column[:, None]), y.reshape(-1), 0.0)[0])
        phi, tangent = mass * column, column[:, None]
        moment = mass * place
    else:
        mass, moment = _mass_and_moment(Y, y, _reach(result.model))
        phi, tangent = (of(np.array([mass, *moment])) for of in (_body, _tangent))
    left = y - Y @ phi
    rate = _rate(result, loaded)
    torque = Y @ phi
    size, rest = float(np.linalg.norm(torque)), float(np.linalg.norm(left))  # weighted
    explained = 1.0 - rest**2 / float(np.sum(y**2))
    z = 0.0
    if size > 0.0:
        z = 1.0 / float(np.sqrt(_spread(result, rows, torque[None] / size**2, left, rate)[0, 0]))
    # one number for both conditions, so that the confidence is above 0.997 exactly where a payload is detected
    least = _TORQUE_SHARE if place is not None else _TORQUE_SHARE_ANYWHERE
    sure = min(z, _SIGNIFICANT_DEVIATIONS * size / max(rest, 1e-300) / least) if mass > 0.0 else 0.0
    X = Y @ tangent
    scale = np.linalg.norm(X, axis=(0, 1))
    scale[scale == 0.0] = 1.0
    inverse = np.asarray(np.linalg.pinv(_flat(X / scale), rcond=1e-6), dtype=np.float64)
    covariance = _spread(result, rows, inverse.reshape(-1, *y.shape), left, rate) / np.outer(scale, scale)
    deviation = np.sqrt(np.diag(covariance))
    deviation[np.diag(inverse @ _flat(X / scale)) < 0.99] = np.inf  # of a direction that the inverse leaves out
    zeros = np.array([(own - of @ baseline) - of @ phi for of, own in rows.means])
    shrunk = rows.independent[:, None] * rows.zeros**2
    zeros *= shrunk / (1.0 + shrunk)
    noise = [rms(left[part]) ** 2 / count for part, count in zip(rows.places, rows.independent, strict=True)]
    of_load = [np.einsum("ik,kl,il->i", of @ tangent, covariance, of @ tangent) for of, _ in rows.means]
    zeros_std = np.sqrt(np.array(noise) + np.array(of_load))
    # what a load or zeros that shifted would ask alike: its mean torque, beside the noise of means
    alike = [float(np.sum((of @ phi) ** 2 / n_)) for (of, _), n_ in zip(rows.means, noise, strict=True)]
    body = np.array([mass, *moment])
    told = place is not None or deviation[0] < _TOLD_DEVIATION * mass
    hidden = deviation > _HIDDEN_DEVIATION
    deviation[hidden] = np.nan
    if place is None:
        moment = np.where(hidden[1:], np.nan, moment)
    estimate = PayloadEstimate(
        name,
        mass if told else None,
        float(deviation[0]) if told else None,
        moment,
        deviation[1:] if place is None else float(deviation[0]) * np.abs(place),
        sure >= _SIGNIFICANT_DEVIATIONS,
        erf(sure / sqrt(2.0)),
        explained,
        likely=(name,),
        zeros=zeros / rows.weights,
        zeros_std=zeros_std / rows.weights,
        like_zeros=bool(
            sure < _SIGNIFICANT_DEVIATIONS < np.sqrt(sum(alike)) and z < _SIGNIFICANT_DEVIATIONS and mass > 0.0
        ),
    )
    return estimate, rest**2, body, int(_shifted(zeros, zeros_std).sum())


def _mass_and_moment(Y: Floats, y: Floats, reach: float) -> tuple[float, Floats]:
    """Return point mass [kg] and mass times place (3,) [kg m] whose torques Y phi are nearest to y, within reach.

    A mass far from every axis shows by its inertia too: the equation is quadratic, and solved from several masses.
    """
    R = np.asarray(np.linalg.qr(np.hstack([_flat(Y), y.reshape(-1, 1)]), mode="r"))
    small = _SMALL_MASS_PENALTY * float(np.linalg.norm(R[:, PER_LINK]))
    from scipy.optimize import least_squares

    def misfit(unknown: Floats) -> Floats:
        error = R[:, :PER_LINK] @ (unknown[0] * point_mass(unknown[1:])) - R[:, PER_LINK]
        return np.append(error, small * unknown[0])

    solutions = []
    bounds = ([1e-4] + [-reach] * 3, [1e3] + [reach] * 3)
    linear = scaled_solution(R[:, :4], R[:, PER_LINK], _VISIBLE_RATIO)
    for start in (0.05, 0.2, 1.0, 5.0):
        at = np.clip(linear[1:] / start, -0.9 * reach, 0.9 * reach)
        solutions.append(least_squares(misfit, [start, *at], bounds=bounds, x_scale="jac"))
    lowest = min(solution.cost for solution in solutions)
    # masses that explain the same differ in what does not show: the smallest is taken
    best = min((s for s in solutions if s.cost <= 1.005 * lowest), key=lambda s: float(s.x[0]))
    return float(best.x[0]), float(best.x[0]) * np.asarray(best.x[1:])


def _body(body: Floats) -> Floats:
    """Return the ten parameters of a point mass by its mass and its moment (4,)."""
    return body[0] * point_mass(body[1:] / body[0])


def _tangent(body: Floats) -> Floats:
    """Return the derivative (10, 4) of a point mass's parameters by mass and moment (4,), by central differences."""
    sizes = 1e-6 * np.array([body[0], *[max(float(np.abs(body[1:]).max()), 1e-3 * body[0])] * 3])
    ways = [(_body(body + step) - _body(body - step)) / (2.0 * step.sum()) for step in np.diag(sizes)]
    return np.column_stack(ways)


def _flat(X: Floats) -> Floats:
    return X.reshape(-1, X.shape[2])


def _rows(result: Identification, samples: Sequence[Samples], link: int) -> _Equations:
    """Return weighted torques of a body on a link, and weighted residuals, zeros integrated out."""
    weights, rate = one_over(result.usual), _rate(result, samples)
    parts, rows = [], 0
    for part in samples:
        whole = part.body_torques(result.model, link) * weights[:, None]
        left = (part.tau - result.predict_samples(part)) * weights
        count = len(part) / _lags(result, len(part), rate) / _repeats(result, len(part))
        size = rms(part.tau + part.known) * weights
        taken = 1.0 - 1.0 / np.sqrt(1.0 + count * size**2)
        means = whole.mean(axis=0), left.mean(axis=0)
        place = slice(rows, rows := rows + len(left))
        parts.append((whole - taken[:, None] * means[0], left - taken * means[1], means, place, size, count))
    X, y, of_parts, places, zeros, counts = map(list, zip(*parts, strict=True))
    stacked = np.concatenate(X), np.concatenate(y)
    return _Equations(*stacked, of_parts, places, np.array(zeros), np.array(counts), weights)


def _spread(result: Identification, rows: _Equations, inverse: Floats, left: Floats, rate: float) -> Floats:
    """Return the covariance (k, k) of sum_t inverse[:, t] left[t], correlated in time (Newey, West 1987).

    It is widened for the few independent rows of a short recording by the ratio of the 95 % points of Kiefer and
    Vogelsang (2005, table 1, Bartlett) to a normal distribution's.
    """
    terms = np.einsum("kta,ta->tk", inverse, left)
    count = len(terms)
    lags = _lags(result, count, rate)
    total = terms.T @ terms
    for lag in range(1, lags):
        shifted = terms[lag:].T @ terms[:-lag]
        total = total + (1.0 - lag / lags) * (shifted + shifted.T)
    share = lags / count
    total *= (1.0 + (2.9694 * share + 0.4160 * share**2 - 0.5324 * share**3) / 1.96) ** 2
    spread: Floats = total * _repeats(result, count) + 1e-30 * np.eye(len(total))
    for part, size, independent in zip(rows.places, rows.zeros, rows.independent, strict=True):
        moved = inverse[:, part].sum(axis=1) * size / np.sqrt(1.0 + independent * size**2)  # by a zero of its size
        spread += moved @ moved.T
    return spread


def _lags(result: Identification, rows: int, rate: float) -> int:
    """Return over how many rows residuals hang together."""
    return 1 if result.options.terms == "static" else max(1, min(int(_CORRELATED_S * rate), rows // 4))


def _repeats(result: Identification, rows: int) -> float:
    """Return how often the recordings repeat the excitation's period."""
    period = filter_of(result.model, result.options).period_samples
    return 1.0 if period is None or result.options.terms == "static" else max(1.0, rows / period)
