"""Prior knowledge of an arm's parameters, from its file's masses or from an identification.

An identification gives its parameters' covariance, and friction of another day.
"""

from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, link_parameters
from catenary.identification.base_parameters import Parameters
from catenary.identification.consistency import MASS_SHARE, SPREADS, mass_covariance
from catenary.identification.identification import Identification
from catenary.robots.model import RobotModel

_FREE_SPREADS = ((0.3, 0.0, 0.4), (3.0, 0.0, 0.4), (30.0, 0.0, 0.2))  # the same about 1 kg and 0.1 m
_LOAD_SHARE, _LEAST_LOAD = 0.12, 1.0  # standard deviation of a load, of the arm's mass, and at least [kg]
_LOAD_REACH_M, _LOAD_INERTIA_M2 = 0.1, 0.02  # of its centre and inertia, per kg
_OTHER_DAY_SHARE = 0.1  # by which friction of another day differs
_OTHER_ZERO_SHARE = 0.03  # of a joint's torque, by which its zero does


@dataclass(frozen=True)
class Belief:
    """A Gaussian mixture over an arm's parameters: links, and the file's actuation too if it was identified."""

    mean: Floats  # (k,)
    covariances: tuple[Floats, ...]  # (k, k) each
    log_weights: tuple[float, ...]
    knows_masses: bool
    links: tuple[int, ...]
    mass: float  # of all links [kg]
    reaches: tuple[float, ...] = ()  # of links [m]: how far from the joint a point mass may be
    identified: bool = False  # with the rotors that it has, none beside
    bodies: tuple[tuple[int, Floats], ...] = ()  # that links carry, see `carrying`

    def carrying(self, link: int, load: Floats) -> "Belief":
        """Return the belief about an arm with a body on a link: load (10, m) times m standard normal numbers."""
        return replace(self, bodies=(*self.bodies, (link, load)))

    def covariance(self, which: int) -> Floats:
        """Return one covariance, with the bodies that links carry."""
        total = self.covariances[which].copy()
        for link, load in self.bodies:
            total[self.own(link), self.own(link)] += load @ load.T
        return total

    def own(self, link: int) -> slice:
        """Return the slice of a link's parameters."""
        return slice(PER_LINK * self.links.index(link), PER_LINK * (self.links.index(link) + 1))

    def after(self, mean: Floats, covariance: Floats) -> "Belief":
        """Return the belief after a recording: links and the file's actuation."""
        mass = float(mean[: PER_LINK * len(self.links) : PER_LINK].sum())
        return Belief(mean, (covariance,), (0.0,), True, self.links, mass, self.reaches)

    @property
    def load(self) -> Floats:
        """A body of unknown mass, place and inertia: standard deviations of its parameters, (10, 10) diagonal."""
        return self.load_mass * np.diag([1.0, *[_LOAD_REACH_M] * 3, *[_LOAD_INERTIA_M2] * 6])

    @property
    def load_mass(self) -> float:
        """Standard deviation of a body's mass [kg]."""
        return max(_LEAST_LOAD, _LOAD_SHARE * self.mass)


def belief_of_file(model: RobotModel) -> Belief:
    """Return the prior of a robot's masses by its file."""
    links = Parameters(model, "full").links
    phi = link_parameters(model.tree).reshape(-1, PER_LINK)[list(links)]
    knows = not model.missing_inertia and float(model.tree.mass.sum()) > 0.0
    spreads = SPREADS if knows else _FREE_SPREADS
    known = phi if knows else 0.0 * phi
    return Belief(
        phi.ravel() * knows,
        tuple(mass_covariance(known, s, common, knows=knows) for s, common, _ in spreads),
        tuple(float(np.log(weight)) for _, _, weight in spreads),
        knows,
        links,
        float(phi[:, 0].sum()) if knows else 0.0,
        tuple(_reach(model, link) for link in links),
    )


def belief_of_known(model: RobotModel, error: float) -> Belief:
    """Return the prior of an arm whose masses are known up to a relative error."""
    file = belief_of_file(model)
    phi = file.mean.reshape(-1, PER_LINK)
    covariance = mass_covariance(phi, error / MASS_SHARE, 0.0)
    return replace(file, covariances=(covariance,), log_weights=(0.0,), identified=True)


def _reach(model: RobotModel, link: int) -> float:
    """Return a link's reach from its joint [m]: to its frames, and the joints that it carries."""
    places = [*model.tree.origin[model.tree.parent == link]]
    places += [frame.pose.position for frame in model.frames.values() if frame.link == link]
    return max(_LOAD_REACH_M, *(float(np.linalg.norm(place)) for place in places))


def belief_of(result: Identification) -> Belief:
    """Return the posterior of an identification: the arm's links, friction, rotors and springs."""
    file, parameters = belief_of_file(result.model), result.base.parameters
    per, count = parameters.per_link, len(parameters.links) * PER_LINK
    terms = len(parameters.actuation)
    P = np.zeros((count + terms, count + terms))
    P[:count, :count] = file.covariances[-1]
    B = np.zeros((result.base.count, count + terms))
    own = np.concatenate([PER_LINK * k + np.arange(per) for k in range(len(parameters.links))])
    B[:, [*own, *range(count, count + terms)]] = result.base.combination
    scale = np.abs(B[:, count:]) * np.abs(result.beta)[:, None]
    P[count:, count:] = np.diag((3.0 * scale.max(axis=0, initial=0.0) + 1e-6) ** 2)
    mean = np.concatenate([file.mean, np.zeros(terms)])
    gain = np.linalg.solve(B @ P @ B.T + result.covariance, B @ P).T
    mean = mean + gain @ (result.beta - B @ mean)
    C = P - gain @ B @ P
    with np.errstate(invalid="ignore", divide="ignore"):  # RMS (n,) of the torques that were fitted
        torque = np.mean([np.nan_to_num(part.rms / part.relative_rms) for part in result.training], axis=0)
    other = _OTHER_DAY_SHARE * np.abs(mean[count:])
    for k, term in enumerate(parameters.actuation):
        if term.kind == "offset":
            other[k] += _OTHER_ZERO_SHARE * float(torque @ np.abs(term.combination))
    C[count:, count:] += np.diag(other**2)
    C = 0.5 * (C + C.T) + 1e-12 * np.diag(np.diag(P))
    return Belief(mean, (C,), (0.0,), True, file.links, float(mean[:count:PER_LINK].sum()), file.reaches, True)
