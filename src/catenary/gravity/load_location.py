"""Localisation of an unknown load: the probability of each frame to carry it, from torques.

A load of mass m and first moment m c on frame k changes the compact parameters by V_k (m, m c). With torques in
standard deviations of their noise, y = Z (ds + V_k x) + noise, where ds is what is not known of the arm itself
(information K) and x is in units of the load's own standard deviations, each hypothesis is linear and Gaussian, and its
evidence is exact:

log p(y | k) = log p(y | no load) + 1/2 b^T (1 + J)^-1 b - 1/2 log det(1 + J)
J = V_k^T (A - A (A + K)^-1 A) V_k,   b = V_k^T (a - A (A + K)^-1 a),   A = sum Z^T Z,   a = sum Z^T y

[a Bayes factor of nested linear models: MacKay 2003, Information theory, inference and learning algorithms, ch. 28].
How large a load is nobody knows beforehand, and a standard deviation of kilograms calls a wrong link surely the right
one where the load is a small one: of two frames that explain it alike, that one wins whose load is thought larger. So
its size is unknown too: x has the given standard deviations, or a half, a quarter ... of them, and its moment all of
that, a half or a quarter, as it hangs far from the frame's origin or near; p(y | k) is the mean over these.
Where the columns of two frames coincide in all poses seen, Z V_j = Z V_k X, both explain the torques as well and share
the probability: such as two links with a joint between that stands upright and has not moved, or a load near that
joint's axis, which the joint does not feel. Beyond the gravity-regressor paper.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, as_positive
from catenary.gravity.compact_regressor import CompactRegressor
from catenary.gravity.payload import PER_LOAD, load_directions

_SURE_PROBABILITY = 0.95  # what the carriers that are named together hold of all probability
_TELLING_DEVIATIONS = 3.0  # standard deviations of torque by which carriers must differ for a pose to tell between them
_JOINT_STEPS = (0.0, -0.8, -0.4, 0.4, 0.8)  # [rad], a fifth of it in m: how far a joint is thought to move
# standard deviations of a large load's mass [kg] and of its moment about the frame's origin [kg m]
LOAD_SIZE = (2.0, 0.3)
_LOAD_OCTAVES = 0.5 ** np.arange(7.0)  # sizes of loads over that, each as likely beforehand: down to 30 g
_MOMENTS = (1.0, 0.5, 0.25)  # of a load's size: what its moment has beforehand, each as likely


class CarrierBelief(NamedTuple):
    """A frame that may carry the load."""

    frame: str
    probability: float  # that it does
    mass: float  # [kg] if it does; below zero where one was put down
    mass_std: float  # [kg]
    moment: Floats  # (3,) mass times place in the frame [kg m] if it does


class LoadBeliefs(NamedTuple):
    """Estimate of a load from torques; probabilities of all carriers and of none add up to one."""

    no_load: float  # probability that nothing changed
    carriers: tuple[CarrierBelief, ...]  # the likeliest first
    # whose motion would tell between the two likeliest, where poses so far do not
    telling_joint: str | None = None

    @property
    def likely(self) -> tuple[str, ...]:
        """The fewest carriers that together hold 95 % of the probability of a load."""
        return likely([c.frame for c in self.carriers], [c.probability for c in self.carriers])

    def __str__(self) -> str:
        if self.no_load > 0.5:
            return f"no load, with probability {self.no_load:.2f}"
        return location_text(self.likely, self.telling_joint)


class LoadHypotheses:
    """One hypothesis per frame that may carry a load; torques are taken one after the other."""

    def __init__(
        self, regressor: CompactRegressor, frames: Sequence[str], load: tuple[float, float] = LOAD_SIZE
    ) -> None:
        """Take the frames, and the standard deviations of a large load's mass [kg] and moment [kg m]."""
        self.frames, self._regressor = tuple(frames), regressor
        self._sizes = np.repeat(as_positive("load", load, (2,)), (1, PER_LOAD - 1))
        p = len(regressor.labels)
        loads = [load_directions(regressor, frame) * self._sizes for frame in frames]
        self.directions = np.hstack([np.empty((p, 0)), *loads])  # V, four columns a frame
        self._p = p
        self.restart(None)

    def restart(self, known: Floats | None) -> None:
        """Forget all torques; `known` (p, p) is the information of the arm's own parameters, None if they are known."""
        self._known = known
        self._squares, self._products = np.zeros((self._p, self._p)), np.zeros(self._p)

    def take(self, Z: Floats, y: Floats) -> None:
        """Take the regressor (n, p) and what the unloaded arm leaves of the torque (n,), both over the noise."""
        self._squares += Z.T @ Z
        self._products += Z.T @ y

    def beliefs(self, q: Floats, gravity: Floats, noise: Floats, beforehand: float | None = None) -> LoadBeliefs:
        """Return probabilities and masses at q (n,), from where a joint may move to tell more.

        Frames are as likely beforehand, which is the probability of a load; when None, of none as well.
        """
        none, *shares = self.shares(beforehand)
        _, means, covariances = self._loads()
        deviations = self._sizes[0] * np.sqrt(covariances[:, 0, 0])
        each = zip(self.frames, shares, deviations.tolist(), self._sizes * means, strict=True)
        carriers = [
            CarrierBelief(frame, share, float(m), std, np.array(moment)) for frame, share, std, (m, *moment) in each
        ]
        return load_beliefs(self._regressor, none, carriers, q, gravity, noise)

    def shares(self, beforehand: float | None = None) -> list[float]:
        """Return the probability of no load, and of a load on each frame; see `beliefs`."""
        count = len(self.frames)
        prior = count / (count + 1.0) if beforehand is None else beforehand
        logs = np.append(np.log(1.0 - prior), np.log(prior / count) + self.evidence())
        return np.exp(logs - np.logaddexp.reduce(logs)).tolist()

    def evidence(self) -> Floats:
        """Return log p(y | load) - log p(y | no load) of each frame."""
        return self._loads()[0]

    def _loads(self) -> tuple[Floats, Floats, Floats]:
        """Return each frame's evidence and load by `load_of_any_size`, what is not known of the arm taken out."""
        A, a = self._squares, self._products
        if self._known is not None:
            A, a = A - A @ np.linalg.solve(A + self._known, A), a - A @ np.linalg.solve(A + self._known, a)
        V = self.directions.T.reshape(len(self.frames), PER_LOAD, -1)  # transposed
        return load_of_any_size(V @ A @ V.swapaxes(1, 2), V @ a, _MOMENTS)


def load_of_any_size(
    information: Floats, score: Floats, others: Sequence[float] = (1.0,)
) -> tuple[Floats, Floats, Floats]:
    """Return the evidence and the estimate of loads whose size has a prior over many scales.

    Args:
        information, score: J (..., k, k) and b (..., k) of loads, in standard deviations of a large one.
        others: What all numbers but the first may be of a size, each as likely.

    Returns:
        log p(y | load) - log p(y | no load) (...), loads (..., k) and their covariances (..., k, k).
    """
    sizes = [(size, *[size * other] * (score.shape[-1] - 1)) for size in _LOAD_OCTAVES for other in others]
    scales = np.reshape(sizes, (len(sizes), *[1] * (information.ndim - 2), -1))
    squares = scales[..., :, None] * scales[..., None, :]
    whole = np.eye(score.shape[-1]) + squares * information
    covariances = squares * np.linalg.inv(whole)
    means = (covariances @ score[..., None])[..., 0]
    logs = 0.5 * np.sum(means * score, axis=-1) - 0.5 * np.linalg.slogdet(whole)[1]
    total = np.logaddexp.reduce(logs, axis=0)
    return total - np.log(len(logs)), *mixed(np.exp(logs - total), means, covariances)


def mixed(shares: Floats, means: Floats, covariances: Floats) -> tuple[Floats, Floats]:
    """Return the mean (..., k) and covariance (..., k, k) of a mixture of Gaussians.

    Args:
        shares, means, covariances: Of the components (N, ...), of sum one; (N, ..., k), (N, ..., k, k).
    """
    mean: Floats = np.einsum("n...,n...i->...i", shares, means)
    spread = means - mean
    return mean, np.einsum("n...,n...ij->...ij", shares, covariances + spread[..., None] * spread[..., None, :])


def load_beliefs(
    regressor: CompactRegressor,
    none: float,
    carriers: Sequence[CarrierBelief],
    q: Floats,
    gravity: Floats,
    noise: Floats,
) -> LoadBeliefs:
    """Return beliefs about carriers, likeliest first, with the joint that tells between the first two if need be.

    Args:
        none, carriers: Probability of no load, and what is known of each frame.
        regressor, q, gravity, noise: See `telling_joint`.
    """
    beliefs = LoadBeliefs(none, tuple(sorted(carriers, key=lambda one: -one.probability)))
    if len(beliefs.likely) < 2:
        return beliefs
    pair = [(one.frame, np.array([one.mass, *one.moment])) for one in beliefs.carriers[:2]]
    return beliefs._replace(telling_joint=telling_joint(regressor, pair, q, gravity, noise))


def likely(names: Sequence[str], shares: Sequence[float]) -> tuple[str, ...]:
    """Return the smallest set of hypotheses that holds 95 % of the probability, likeliest first.

    Args:
        names, shares: Hypotheses, and their probabilities up to a factor.
    """
    order = np.argsort([-share for share in shares], kind="stable")
    held = np.cumsum(np.array(shares)[order]) / sum(shares)
    return tuple(names[k] for k in order[: int(np.searchsorted(held, _SURE_PROBABILITY)) + 1])


def telling_joint(
    regressor: CompactRegressor, loads: Sequence[tuple[str, Floats]], q: Floats, gravity: Floats, noise: Floats
) -> str | None:
    """Return the joint whose motion best separates two loads, or a load from a constant torque; None if none does.

    Args:
        loads: One or two loads: a frame, with mass and first moment (4,) [kg, kg m].
        q: Configuration (n,) from which one joint at a time moves within its limits [rad or m].
        gravity: Free-fall acceleration in base axes (3,) [m/s2].
        noise: Standard deviation of the torques (n,) [Nm|N].
    """
    model = regressor.model
    first, *others = (load_directions(regressor, frame) @ load for frame, load in loads)
    difference = first - sum(others, np.zeros_like(first))
    largest, best = _TELLING_DEVIATIONS, None
    for joint, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True)):
        steps = np.array(_JOINT_STEPS) * (1.0 if unit == "rad" else 0.2)
        poses = np.tile(q, (len(steps), 1))
        poses[:, joint] = np.clip(q[joint] + steps, model.lower[joint], model.upper[joint])
        torque = regressor.Z(poses, gravity) @ difference
        differ = float(np.abs((torque[1:] - (0.0 if others else torque[0])) / noise).max())
        if differ > 1.05 * largest:  # of joints that tell as much, the first
            largest, best = differ, name
    return best


def location_text(frames: Sequence[str], joint: str | None) -> str:
    """Return the sentence that names a load's frame, or frames that poses cannot separate and the joint to move.

    Args:
        frames: One or more frames.
        joint: Joint whose motion separates them; None if none does.
    """
    if len(frames) == 1:
        return f"on {frames[0]}"
    names = f"{', '.join(frames[:-1])} and {frames[-1]}"
    how = f"move {joint}" if joint is not None else "no single joint's motion would distinguish them"
    return f"between {names}: cannot be distinguished by these poses; {how}"
