"""What an arm carries beyond what it was identified with: how much, where, on which link.

A load is a body of unknown mass beside the arm's own parameters, which explanations/loads.py weighs. Several links may
explain the torques as well: then they share the probability, and none is named alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch, as_positive, one_for_all
from catenary.dynamics.actuation_loads import known_torque
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.load_location import (
    CarrierBelief,
    LoadBeliefs,
    likely,
    load_beliefs,
    location_text,
    telling_joint,
)
from catenary.identification.explanations.evidence import Evidence
from catenary.identification.explanations.loads import Load, differences, weigh_loads
from catenary.identification.explanations.priors import belief_of, belief_of_known
from catenary.identification.identification import Identification
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel

_SURE = 0.997  # probability of a load from which one is named
_TOLD_DEVIATION = 0.3  # of a mass: a larger standard deviation, and the recordings do not tell it
_HIDDEN_SHARE = 0.7  # of what was thought beforehand of a moment: a larger deviation, and recordings do not show it
_RIVAL_MARGIN = 5.0  # [nats] within which something else explains torques as well as a load, and more than nothing


@dataclass(frozen=True)
class PayloadEstimate:
    """A body on a link; `mass` or `moment` is None if the recordings cannot tell it."""

    link: str
    mass: float | None  # [kg]
    mass_std: float | None
    moment: Floats | None  # (3,) mass times position [kg m], in the link's frame; NaN if it does not show
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


def estimate_payload(result: Identification, loaded: Sequence[Samples], **how: Any) -> PayloadEstimate:
    """Return the likeliest payload of `payload_candidates`.

    Args:
        result, loaded: Identification of the arm without a load, and filtered rows of recordings with it.
        **how: Further arguments of `payload_candidates`.

    Examples:
        >>> from catenary.identification.identify_options import IdentifyOptions
        >>> from catenary.identification.samples import prepare
        >>> arm, w, t = catenary.load_robot("two_link"), np.array([1.0, 1.7]), np.linspace(0.0, 20.0, 4000)[:, None]
        >>> q, qd, qdd = np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)
        >>> logs = [
        ...     catenary.MotionLog(
        ...         name, arm.joint_names, arm.joint_units, q, np.ones(len(q), bool), time=t[:, 0], qd=qd,
        ...         tau=catenary.inverse_dynamics(robot, q, qd, qdd, [0.0, 0.0, -9.81]),
        ...     )
        ...     for name, robot in (("alone", arm), ("loaded", arm.with_payload(arm.tip, 0.5, [0.0, 0.0, 0.0])))
        ... ]
        >>> result = catenary.identify(logs[:1], arm)
        >>> loaded = prepare(logs[1], arm, IdentifyOptions())
        >>> round(catenary.estimate_payload(result, [loaded], at=(arm.tip, [0.0, 0.0, 0.0])).mass, 2)
        0.5
    """
    return payload_candidates(result, loaded, **how)[0]


def payload_candidates(
    result: Identification,
    loaded: Sequence[Samples],
    *,
    at: tuple[str, ArrayLike] | None = None,
    unloaded: Sequence[Samples] = (),
) -> tuple[PayloadEstimate, ...]:
    """Estimate the payload of an arm that was identified without it on every link, the likeliest first.

    At a known place it is a point mass. Otherwise mass, place and inertia are free on every link; `likely` and
    `location` say which others the recordings cannot tell from it. The parameters' own errors, as the identification
    has them, and what else may differ (see the file) are in the deviations.

    Args:
        loaded: Recordings with the payload, prepared as those that were fitted.
        at: Frame, and the payload's place in it [m], if known.
        unloaded: Recordings without it, of the same day: what they show in its place is the arm's.
    """
    if not loaded:
        raise InputError("payload: expected at least one recording")
    model, belief, others = result.model, belief_of(result), differences(result.model.joint_names)
    of_loaded, of_unloaded = ([Evidence(model, part, belief) for part in parts] for parts in (loaded, unloaded))
    places = [(link, None) for link in belief.links] if at is None else [place_of(result, at)]
    loads = weigh_loads(of_loaded, places, others, unloaded=of_unloaded)
    estimates = [_estimate(model, load, loads.sure, at is None) for load in loads.each]
    best, links = loads.each[0], [estimate.link for estimate in estimates]
    names = likely(links, [load.share for load in loads.each])
    detected, rival = estimates[0].detected, int(np.argmax(best.without))

    def telling(count: int) -> str | None:
        pair = [(link, each.mean[:4]) for link, each in zip(links[:count], loads.each, strict=False)]
        return telling_joint(compact_regressor(model), pair, loaded[0].q[-1], result.gravity, result.usual + 1e-9)

    rival_says = ""
    if rival > 0 and not detected and min(loads.gain, best.without[rival] - best.without[0]) > _RIVAL_MARGIN:
        name = telling(1)
        how = f"move {name}" if name else "no single joint's motion would distinguish them"
        rival_says = f"{others[rival].says}: {how}"
    difference = others[int(np.argmax(best.logs if detected else best.without))].says
    joint = telling(2) if len(names) > 1 else None
    common: dict[str, Any] = {"likely": names, "telling_joint": joint, "beside": difference, "rival": rival_says}
    return tuple(replace(estimate, **common) for estimate in estimates)


def locate_load(
    model: RobotModel,
    q: ArrayLike,
    tau: ArrayLike,
    gravity: ArrayLike,
    *,
    noise: ArrayLike,
    frames: Sequence[str] = (),
    masses: float = 0.01,
) -> LoadBeliefs:
    """Find which frame of a known arm carries an unknown load, from torques that hold it still.

    A gain or a zero of torque, or a base that is tilted, is no load: each is weighed beside it and without it.

    Args:
        model: The arm without the load; needs masses and their centres.
        q: (n,) or (N, n) poses [rad or m]; tau: torques that hold the arm there [Nm|N].
        gravity: (3,) or (N, 3) [m/s2].
        noise: Standard deviation of torques, one for all or (n,) [Nm|N].
        frames: That may carry it; every moving link that is not massless when none are named.
        masses: Relative error of the arm's masses.

    Examples:
        >>> arm = catenary.load_robot("puma560")
        >>> q = np.random.default_rng(0).uniform(-1.0, 1.0, (10, 6))
        >>> loaded = arm.with_payload(arm.tip, 2.0, [0.05, 0.0, 0.05])
        >>> tau = catenary.gravity_torque(loaded, q, [0.0, 0.0, -9.81])
        >>> beliefs = catenary.locate_load(arm, q, tau, [0.0, 0.0, -9.81], noise=0.05)
        >>> print(beliefs)
        on joint6
    """
    rows, _ = as_batch("q", q, model.n)
    torques, _ = as_batch("tau", tau, model.n)
    if torques.shape != rows.shape:
        raise InputError(f"tau: expected shape {rows.shape}, that of q, got {torques.shape}")
    spread = as_positive("noise", one_for_all(noise, model.n), (model.n,))
    as_positive("masses", masses)
    model.require_masses()
    named = list(frames) or [link for link in model.link_names if link not in model.massless]
    on, belief = [model.frame(name) for name in named], belief_of_known(model, masses)
    for name, frame in zip(named, on, strict=True):
        if frame.link not in belief.links:
            raise InputError(f'frames: "{name}" is on no link that moves and has mass: a body there has no effect')
    down = gravity_rows(gravity, len(rows))
    down = down[0] if len(down) == 1 else down
    known = known_torque(model.assumed_actuation, rows)
    still, places = np.zeros_like(rows), np.arange(float(len(rows)))
    samples = Samples("", rows, still, still, torques - known, known, places, 1.0, down)
    evidence = Evidence(model, samples, belief, len(rows), spread)
    loads = weigh_loads([evidence], [(frame.link, None) for frame in on], differences(model.joint_names))
    carriers = []
    for body in loads.each:
        pose = on[body.place].pose
        moment = pose.rotation.T @ (body.mean[1:4] - body.mean[0] * pose.position)
        std = float(np.sqrt(body.covariance[0, 0]))
        carriers.append(CarrierBelief(named[body.place], body.share * loads.sure, float(body.mean[0]), std, moment))
    last = down[-1] if down.ndim == 2 else down
    return load_beliefs(compact_regressor(model), 1.0 - loads.sure, carriers, rows[-1], last, spread)


def place_of(result: Identification, at: tuple[str, ArrayLike]) -> tuple[int, Floats]:
    """Return the link that a frame is on, and a place in it (3,) in the link's frame [m]."""
    frame = result.model.frame(at[0])
    position = as_array("payload position", at[1], (3,))
    if frame.link < 0:
        raise InputError(f'payload: frame "{at[0]}" does not move: what hangs there loads no joint')
    return frame.link, frame.pose.rotation @ position + frame.pose.position


def _estimate(model: RobotModel, of: Load, sure: float, anywhere: bool) -> PayloadEstimate:
    mean, deviation = of.mean, np.sqrt(np.maximum(np.diag(of.covariance), 0.0))
    is_known = not anywhere or deviation[0] < _TOLD_DEVIATION * mean[0]
    mass, mass_std = (float(mean[0]), float(deviation[0])) if is_known else (None, None)
    moment, moment_std = mean[1:4], deviation[1:4]
    if anywhere:
        hidden = moment_std > _HIDDEN_SHARE * np.linalg.norm(of.prior, axis=1)[1:4]
        moment, moment_std = np.where(hidden, np.nan, moment), np.where(hidden, np.nan, moment_std)
    is_there = mean[0] > 0.0
    detected, confidence = bool(is_there and sure >= _SURE), sure if is_there else 0.0
    link = model.link_names[of.link]
    return PayloadEstimate(link, mass, mass_std, moment, moment_std, detected, confidence, of.share)
