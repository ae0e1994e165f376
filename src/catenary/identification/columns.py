"""All parameters of a robot, and the regressor that multiplies them: links first, then actuation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation import NEVER_NEGATIVE, ActuationTerm, actuation_columns, actuation_terms
from catenary.dynamics.regressor import PARAMETER_UNITS, PARAMETERS, PER_LINK, torque_regressor
from catenary.identification.options import Terms, actuation_of
from catenary.robots.model import RobotModel

FIRST_MOMENTS = 4  # of a link's ten parameters, mass and first moment: all that shows at rest


@dataclass(frozen=True)
class Parameters:
    """The parameters of a robot that full dynamics, or poses at rest, can show."""

    model: RobotModel
    terms: Terms
    actuated: bool = True  # with the parameters of friction, rotors and springs

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Links that may have a mass, as indices into the tree."""
        return tuple(i for i, name in enumerate(self.model.link_names) if name not in self.model.massless)

    @cached_property
    def per_link(self) -> int:
        """How many of the ten parameters of a link are among them."""
        return FIRST_MOMENTS if self.terms == "static" else PER_LINK

    @cached_property
    def actuation(self) -> tuple[ActuationTerm, ...]:
        """The parameters beside those of the links."""
        if not self.actuated:
            return ()
        return actuation_terms(actuation_of(self.model), static=self.terms == "static")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """What each is called, in the order of the regressor's columns."""
        bodies = [
            f"{PARAMETERS[p]} {self.model.link_names[i]}" for i in self.links for p in range(self.per_link)
        ]
        return (*bodies, *(f"{term.kind} {term.name}" for term in self.actuation))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """SI units; those of effects on a combination are the combination's."""
        bodies = [PARAMETER_UNITS[p] for _ in self.links for p in range(self.per_link)]
        return (*bodies, *(self._unit(term) for term in self.actuation))

    def _unit(self, term: ActuationTerm) -> str:
        slides = self.model.joint_units[int(np.flatnonzero(term.combination)[0])] == "m"
        if term.kind == "spring" and term.lever is not None:
            return "N/m"
        force, length = ("N", "m") if slides else ("Nm", "rad")
        return {
            "coulomb": force,
            "offset": force,
            "viscous": f"{force} s/{length}",
            "motor_inertia": "kg" if slides else "kg m2",
            "spring": f"{force}/{length}",
        }[term.kind]

    @cached_property
    def never_negative(self) -> tuple[int, ...]:
        """Columns whose parameter cannot be below zero."""
        first = len(self.links) * self.per_link
        return tuple(first + k for k, term in enumerate(self.actuation) if term.kind in NEVER_NEGATIVE)

    def link_columns(self, place: int) -> slice:
        """Return the columns of the link at a place in `links`."""
        return slice(place * self.per_link, (place + 1) * self.per_link)

    def regressor(self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats) -> Floats:
        """Return the matrix (N, n, k) of tau = Y phi at motions (N, n)."""
        whole = torque_regressor(self.model, q, qd, qdd, gravity)
        wanted = [PER_LINK * i + p for i in self.links for p in range(self.per_link)]
        smoothing = actuation_of(self.model).coulomb_velocity
        columns = actuation_columns(self.actuation, q, qd, qdd, smoothing)
        return np.concatenate([whole[:, :, wanted], columns], axis=2)
