"""All parameters of a robot, and the regressor that multiplies them: links first, then actuation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import term_load
from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.torque_regressor import PARAMETER_NAMES, PARAMETER_UNITS, PER_LINK, torque_regressor
from catenary.identification.identify_options import Terms, actuation_of
from catenary.identification.samples import HELD_OUT, Samples
from catenary.robots.actuation import ActuationTerm, actuation_terms
from catenary.robots.friction_terms import NOT_NEGATIVE
from catenary.robots.model import RobotModel

OF_RECORDING = " in "  # between the name of a friction and that of the recording that has it
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
        """Number of parameters per link, at most ten."""
        return FIRST_MOMENTS if self.terms == "static" else PER_LINK

    @cached_property
    def actuation(self) -> tuple[ActuationTerm, ...]:
        """The parameters beside those of the links."""
        if not self.actuated:
            return ()
        return actuation_terms(actuation_of(self.model), static=self.terms == "static")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the regressor's columns."""
        bodies = [f"{PARAMETER_NAMES[p]} {self.model.link_names[i]}" for i in self.links for p in range(self.per_link)]
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
        if term.friction is not None:
            return term.friction.unit("m" if slides else "rad")
        return {"motor_inertia": ("kg m2", "kg"), "spring": ("Nm/rad", "N/m")}[term.kind][slides]

    @cached_property
    def own(self) -> tuple[int, ...]:
        """Columns of friction that no random motion finds dependent on others: they stand beside what is reduced."""
        return tuple(
            self._first + k
            for k, term in enumerate(self.actuation)
            if term.friction is not None and (term.recording or not term.friction.usual)
        )

    @cached_property
    def carrying(self) -> tuple[int, ...]:
        """Columns of what load-dependent friction grows with: links, rotors, springs."""
        beside = (k for k, term in enumerate(self.actuation) if term.friction is None)
        return (*range(self._first), *(self._first + k for k in beside))

    @cached_property
    def rotors(self) -> dict[int, ActuationTerm]:
        """The terms of rotors, by column."""
        return {self._first + k: term for k, term in enumerate(self.actuation) if term.kind == "motor_inertia"}

    @property
    def _first(self) -> int:
        return len(self.links) * self.per_link

    @cached_property
    def bounds(self) -> Floats:
        """Rows (r, k) of B phi >= 0: the bounds of friction terms, and no rotor or spring is below zero.

        What one recording has beside the others leaves its friction zero or more.
        """
        place = {(t.kind, t.name): self._first + k for k, t in enumerate(self.actuation)}
        alone, beside = list[dict[int, float]](), list[dict[int, float]]()
        for (kind, name), term in zip(place, self.actuation, strict=True):
            for factor, other in NOT_NEGATIVE if term.friction is None else term.friction.bounds:
                row = {place[kind, name]: factor}
                if other:
                    beside.append(row | _one(place.get((other, name))))
                else:
                    common = name.removesuffix(f"{OF_RECORDING}{term.recording}") if term.recording else ""
                    alone.append(row | _one(place.get((kind, common))))
        rows = [*alone, *beside]
        B = np.zeros((len(rows), len(self.names)))
        for r, row in enumerate(rows):
            for column, factor in row.items():
                B[r, column] = factor
        return B

    def link_columns(self, place: int) -> slice:
        """Return the columns of the link at a place in `links`."""
        return slice(place * self.per_link, (place + 1) * self.per_link)

    def regressor(
        self, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, *, base: BaseMotion | None = None
    ) -> Floats:
        """Return the matrix (N, n, k) of tau = Y phi at motions (N, n), gravity (3,) or (N, 3) [m/s2] in base axes.

        Friction is as in steady sliding, without load.
        """
        whole = torque_regressor(self.model, q, qd, qdd, gravity, base)
        smoothing = actuation_of(self.model).coulomb_velocity
        each = [term_load(term, q, qd, qdd, smoothing) for term in self.actuation]
        loads = np.column_stack(each) if each else np.zeros((len(q), 0))
        return self.beside_links(whole, loads)

    def beside_links(self, whole: Floats, loads: Floats) -> Floats:
        """Return the matrix (N, n, k) of all links' columns (N, n, 10 L) and the loads (N, t) of the actuation."""
        wanted = [PER_LINK * i + p for i in self.links for p in range(self.per_link)]
        along = np.array([term.combination for term in self.actuation]).reshape(-1, whole.shape[1])
        columns = loads[:, None, :] * along.T[None]
        return np.concatenate([whole[:, :, wanted], columns], axis=2)

    def loads(self, samples: Samples) -> Floats:
        """Return the loads (N, t) of the actuation's terms on a recording's rows, as friction remembers its history."""
        smoothing = actuation_of(self.model).coulomb_velocity
        each = [recorded_load(term, samples, smoothing) for term in self.actuation]
        return np.column_stack(each) if each else np.zeros((len(samples), 0))


def recorded_load(term: ActuationTerm, samples: Samples, coulomb_velocity: float) -> Floats:
    """Return the load (N,) of a term on a recording's rows, per unit, as friction remembers the motion."""
    if term.recording and samples.name.removesuffix(HELD_OUT) != term.recording:
        return np.zeros(len(samples))
    friction = term.friction
    if samples.history is None or friction is None or not (friction.leaps or friction.memory):
        return term_load(term, samples.q, samples.qd, samples.qdd, coulomb_velocity, samples.carried)
    c = term.combination
    load = samples.history.load(friction, c, term.scale, coulomb_velocity)
    if friction.grows_with_load:
        carried = np.zeros(len(samples)) if samples.carried is None else samples.carried @ c
        load = load * np.abs(carried) / (c @ c)
    return load


def _one(column: int | None) -> dict[int, float]:
    return {} if column is None else {column: 1.0}
