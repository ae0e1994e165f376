"""What an arm carries beyond what it was identified with: how much, where, on which link.

A load is a body of unknown mass beside the arm's own parameters, weighed by the evidence of explanations/. What else
may differ from the arm as it was identified, a gain of one joint's torque or of all, a tilt of the base, zeros of
torque, friction, looks like a load to an arm that hardly moves. So each of these is supposed beside the load, one kind
at a time, and without a load as well: what is told is the mean over all, by how likely they are [Hoeting, Madigan,
Raftery, Volinsky 1999, Bayesian model averaging: a tutorial]. All kinds at once would widen the interval for nothing.

Several links may explain the torques as well: then they share the probability, and none is named alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats, as_array
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.load_location import JOINT_STEPS, likely, location_text, telling_joint
from catenary.identification.explanations.beliefs import Belief, belief_of
from catenary.identification.explanations.evidence import Evidence, Extra, Fit
from catenary.identification.explanations.findings import posterior
from catenary.identification.identification import Identification
from catenary.identification.samples import Samples

_SURE = 0.997  # probability of a load from which on one is named
_TOLD_DEVIATION = 0.3  # of a mass: a larger standard deviation, and the recordings do not tell it
_HIDDEN_SHARE = 0.7  # of what was thought beforehand of a moment: a larger deviation, and recordings do not show it
_LOAD_PRICE = 1.0  # [nats] by which a load is less likely beforehand than none
_RIVAL_MARGIN = 5.0  # [nats] within which something else explains torques as well as a load, and more than nothing
_TELLING_DEVIATIONS = 3.0  # of a joint's usual residual, by which its motion changes a load's torque
_GAIN_STD, _TILT_STD_RAD, _FRICTION_STD = 0.05, np.deg2rad(2.5), 0.3
_ZERO_SHARE = 1.0  # standard deviation of a zero, of its joint's torque


@dataclass(frozen=True)
class PayloadEstimate:
    """A body on a link; `mass` or `moment` is None where the recordings cannot tell it."""

    link: str
    mass: float | None  # [kg]
    mass_std: float | None
    moment: Floats | None  # (3,) mass times position [kg m], in the link's frame; NaN where it does not show
    moment_std: Floats | None
    detected: bool
    confidence: float  # that there is a load, 0 to 1
    probability: float = 1.0  # that it is on this link, if there is one; 1 where its place was given
    likely: tuple[str, ...] = ()  # the fewest links that hold 95 % of that, likeliest first
    telling_joint: str | None = None  # whose motion would tell between the first two, where these recordings do not
    beside: str = ""  # what else differs from the arm that was identified, if something is likelier than nothing
    rival: str = ""  # what would explain the torques as well, without a load

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

    At a known place it is a point mass. Otherwise mass, place and inertia are free on every link, and the likeliest
    link is taken; `likely` and `location` say which others the recordings cannot tell from it. The parameters' own
    errors, as the identification has them, and what else may differ (see the file) are in the deviations.

    Args:
        result: The identified dynamics.
        loaded: Recordings with the payload, prepared as those that were fitted.
        at: Frame, and the payload's place in it [m], if known.
        unloaded: Recordings without it, of the same day: what they show in its place is the arm's.

    Raises:
        InputError: No recording, an unknown frame or one at rest, or a model of poses at rest and a moving recording.
    """
    if not loaded:
        raise InputError("payload: expected at least one recording")
    places = None if at is None else [place_of(result, at)]
    return _candidates(result, loaded, unloaded, places)[0]


def payload_candidates(
    result: Identification, loaded: Sequence[Samples], *, unloaded: Sequence[Samples] = ()
) -> tuple[PayloadEstimate, ...]:
    """Estimate the payload on every link, with the probability that it is there; the likeliest link first."""
    return _candidates(result, loaded, unloaded, None)


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


class _Difference(NamedTuple):
    """A kind of difference between an arm as it was identified and as it was recorded."""

    says: str
    price: float  # [nats]
    columns: Callable[["_Recording", Floats], list[Extra]]  # from a recording and the parameters that explain it


class _Recording:
    """One recording of the arm."""

    def __init__(self, result: Identification, samples: Samples, belief: Belief) -> None:
        self.evidence = Evidence(result.model, samples, belief)
        self.X, _, self.terms = self.evidence.columns(self.evidence.plain)
        rows, plain = self.evidence.rows, self.evidence.plain
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
        """Return what turning the base changes, about two axes."""
        return [Extra(dX @ beta[: self.evidence.shown], 0.0, _TILT_STD_RAD) for dX in self.turned]


def _alone(torque: Floats, joint: int, std: float) -> Extra:
    """Return torques (N, n) of one joint as a column."""
    return Extra(np.where(np.arange(torque.shape[1]) == joint, torque, 0.0), 0.0, std)


def _differences(names: Sequence[str]) -> Iterator[_Difference]:
    """Yield what may differ, nothing first."""
    of_joint = float(np.log(3.0 * len(names)))
    yield _Difference("", 0.0, lambda recording, beta: [])
    yield _Difference("all torques times a gain", 1.5, _Recording.gain)
    yield _Difference("a tilt of the base", 1.5, _Recording.tilt)
    yield _Difference("friction", 1.5, _Recording.friction)
    yield _Difference("zeros of torque", 1.5, partial(_Recording.zeros, joints=range(len(names))))
    for j, name in enumerate(names):
        yield _Difference(f"{name}'s torque times a gain", of_joint, partial(_Recording.gain, joint=j))
        yield _Difference(f"{name}'s zero of torque", of_joint, partial(_Recording.zeros, joints=(j,)))


class _Weighed(NamedTuple):
    """A load on a link, over all differences."""

    link: int
    load: Floats  # (10, m) of its parameters beforehand
    logs: Floats  # (d,) log evidence with each difference
    without: Floats  # the same without a load
    mean: Floats  # (10,) of its parameters
    covariance: Floats


def _candidates(
    result: Identification,
    loaded: Sequence[Samples],
    unloaded: Sequence[Samples],
    places: Sequence[tuple[int, Floats]] | None,
) -> tuple[PayloadEstimate, ...]:
    """Return what each link may carry, likeliest first; a point mass at its place where places are given."""
    model, belief = result.model, belief_of(result)
    differences = list(_differences(model.joint_names))
    with threadpool_limits(limits=1):  # matrices are small: BLAS threads would only wait for each other
        recordings, empty = ([_Recording(result, part, belief) for part in parts] for parts in (loaded, unloaded))
        wanted = [(link, None) for link in belief.links] if places is None else places
        weighed = [_weigh(recordings, empty, belief, differences, *each) for each in wanted]
    price = _LOAD_PRICE + float(np.log(len(weighed)))
    evidence = np.array([np.logaddexp.reduce(each.logs) - price for each in weighed])
    none = np.array([np.logaddexp.reduce(each.without) - np.log(len(weighed)) for each in weighed])
    some, nothing = float(np.logaddexp.reduce(evidence)), float(np.logaddexp.reduce(none))
    sure, shares = float(np.exp(some - np.logaddexp(some, nothing))), np.exp(evidence - some)
    order = sorted(range(len(weighed)), key=lambda k: -shares[k])
    names = likely([model.link_names[weighed[k].link] for k in order], [shares[k] for k in order])
    found = [_estimate(result, weighed[k], sure, places is None) for k in order]
    best, joint = weighed[order[0]], None
    if len(names) > 1:
        pair = [(model.link_names[weighed[k].link], weighed[k].mean[:4]) for k in order[:2]]
        joint = telling_joint(compact_regressor(model), pair, loaded[0].q[-1], result.gravity, result.usual + 1e-9)
    beside = differences[int(np.argmax(best.logs if found[0].detected else best.without))].says
    rival = int(np.argmax(best.without))
    gains = best.logs[0] - price - best.without[0], best.without[rival] - best.without[0]
    alike = rival > 0 and min(gains) > _RIVAL_MARGIN and sure < _SURE
    told = ""
    if alike:
        name = _separating_joint(result, loaded[0].q[-1], best)
        how = f"move {name}" if name else "no joint would tell, moved by itself"
        told = f"{differences[rival].says}: {how}"
    return tuple(
        replace(of, probability=float(shares[k]), likely=names, telling_joint=joint, beside=beside, rival=told)
        for of, k in zip(found, order, strict=True)
    )


def _weigh(
    loaded: Sequence[_Recording],
    unloaded: Sequence[_Recording],
    start: Belief,
    differences: Sequence[_Difference],
    link: int,
    place: Floats | None,
) -> _Weighed:
    """Weigh a load on a link, beside everything that may differ."""
    load = start.load if place is None else start.load_mass * point_mass(place)[:, None]
    logs, without, bodies = [], [], []
    for kind in differences:
        before, day = 0.0, start
        if unloaded:
            before, day = _chain(unloaded, start.carrying(link, load), kind)[::2]
        carrying = day.carrying(link, load)
        none, _, _ = _chain(loaded, day, kind)
        some, fit, _ = _chain(loaded, carrying, kind)
        evidence = loaded[0].evidence.believing(carrying)
        m = evidence.onto.shape[1]
        bodies.append(evidence.body(link, load, 0, (), fit.beta[:m], fit.covariance[:m, :m]))
        logs.append(before + some - kind.price)
        without.append(before + none - kind.price)
    share = np.exp(np.array(logs) - np.logaddexp.reduce(logs))
    means, covariances = (np.array(each) for each in zip(*bodies, strict=True))
    mean = share @ means
    spread = means - mean
    covariance = np.einsum("d,dij->ij", share, covariances) + np.einsum("d,di,dj->ij", share, spread, spread)
    return _Weighed(link, load, np.array(logs), np.array(without), mean, covariance)


def _chain(recordings: Sequence[_Recording], belief: Belief, kind: _Difference) -> tuple[float, Fit, Belief]:
    """Return the log evidence of recordings one after the other, the last fit, and what is believed of the arm then."""
    total = 0.0
    for of in recordings:
        evidence = of.evidence.believing(belief)
        extra = kind.columns(of, evidence.fit(evidence.plain, 0).beta)
        fit = evidence.fit(evidence.plain, 0, extra)
        total += fit.log_evidence
        belief = posterior(evidence, extra)
    return total, fit, belief


def _estimate(result: Identification, of: _Weighed, sure: float, anywhere: bool) -> PayloadEstimate:
    """Return what is told of a load on a link."""
    mean, deviation = of.mean, np.sqrt(np.maximum(np.diag(of.covariance), 0.0))
    told = not anywhere or deviation[0] < _TOLD_DEVIATION * mean[0]
    moment, moment_std = mean[1:4], deviation[1:4]
    if anywhere:
        hidden = moment_std > _HIDDEN_SHARE * np.linalg.norm(of.load, axis=1)[1:4]
        moment, moment_std = np.where(hidden, np.nan, moment), np.where(hidden, np.nan, moment_std)
    return PayloadEstimate(
        result.model.link_names[of.link],
        float(mean[0]) if told else None,
        float(deviation[0]) if told else None,
        moment,
        moment_std,
        bool(sure >= _SURE and mean[0] > 0.0),
        sure if mean[0] > 0.0 else 0.0,
    )


def _separating_joint(result: Identification, q: Floats, of: _Weighed) -> str | None:
    """Return the joint whose motion from q (n,) changes a load's torque most beside the usual residual; or None."""
    model, own = result.model, slice(PER_LINK * of.link, PER_LINK * (of.link + 1))
    steps = np.array([0.0, *JOINT_STEPS])
    changes = []
    for joint, unit in enumerate(model.joint_units):
        poses = np.tile(q, (len(steps), 1))
        poses[:, joint] += steps * (1.0 if unit == "rad" else 0.2)
        poses = np.clip(poses, model.lower, model.upper)
        still = np.zeros_like(poses)
        torque = torque_regressor(model, poses, still, still, result.gravity)[:, :, own] @ of.mean
        changes.append(float(np.abs((torque - torque[0]) / (result.usual + 1e-9)).max()))
    best = int(np.argmax(changes))
    return model.joint_names[best] if changes[best] > _TELLING_DEVIATIONS else None
