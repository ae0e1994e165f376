"""Rows of a recording as regressor columns and torques, under what a hypothesis supposes.

Columns are the links' parameters, reduced to the combinations that torques can show, the robot file's friction,
rotors and springs, and friction, a rotor and a zero of every joint beside them. All have a Gaussian prior, so that none
is singular. What stands beside the links is sized by the RMS of its joint's torque.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.identification.base_parameters import Parameters, recorded_load
from catenary.identification.identification import ROTOR_SHARE
from catenary.identification.samples import Samples
from catenary.identification.velocities import VelocityFault
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY

_SLOW = {"rad": 0.02, "m": 0.005}  # [rad/s, m/s] speed of tanh(v / slow) in Coulomb friction: velocities have noise
_STRIBECK_RATIO = 5.0  # of Stribeck's speed to that
# standard deviations beforehand, of the RMS of the joint's torque
_COULOMB_SHARE, _TERM_SHARE = 0.3, 0.5
_STRIBECK_SHARE, _LOADED_SHARE, _QUADRATIC_SHARE = 0.1, 0.07, 0.1
_SHARED_SHARE, _SHARED_ROTOR_SHARE = 0.3, 0.2
_ENDS_SHARE = 0.02  # of the rows, left out at either end
_LEAST_TORQUE = 0.002  # of the largest joint's RMS: the least size that a joint's torque is given
_DRAWN_ROWS, _VISIBLE_RATIO = 60, 1e-9  # of random motion, which tells the combinations that torques can show


class Added(NamedTuple):
    """What torques have beside what the arm asks, linear in one number or several."""

    shape: str  # zero, drift, friction or load
    joint: int  # whose torque has it; of a load -1, as it is on the tip
    sizes: tuple[float, ...]  # standard deviations of its numbers beforehand
    after: float | None = None  # [s] from when on; all along when None


@dataclass(frozen=True)
class Supposed:
    """Changes that lie between the arm's motion and the recording of it, and what the arm has beside its file."""

    signs: tuple[float, ...]  # (n,) of recorded positions: -1 where they count the other way
    zeros: tuple[float, ...]  # (n,) [rad or m] that recorded positions are too large by
    position_order: tuple[int, ...]  # column of the recording that holds each joint's position
    torque_order: tuple[int, ...]  # the same of its torque
    gains: tuple[float, ...]  # (n,) of recorded torques to true ones
    late: tuple[int, ...]  # (n,) rows of the recording, delay of torques behind positions
    gravity: tuple[float, ...] | None = None  # (3,) [m/s2] in base axes; None: as stated or recorded
    loads: tuple[int, ...] = ()  # links that carry a body which the prior of masses lacks
    shared: tuple[tuple[int, int, float], ...] = ()  # joints on one drive, and the sign of the second
    added: tuple[Added, ...] = ()
    derived: tuple[int, ...] | None = None  # joints whose velocities are those of the positions, if it is known
    turned: tuple[tuple[int, float], ...] = ()  # joints whose torque has the other sign, and from when on [s]

    @property
    def motion(self) -> tuple[Any, ...]:
        """What decides on the columns of the regressor."""
        return self.signs, self.zeros, self.position_order, self.gravity, self.shared, self.derived

    def with_one(self, field: str, joint: int, value: float) -> "Supposed":
        """Return the supposition with another number for one joint."""
        values: list[float] = list(getattr(self, field))
        values[joint] = value
        return replace(self, **{field: tuple(values)})  # type: ignore[arg-type]  # a field by its name

    def with_swapped(self, fields: Sequence[str], i: int, j: int) -> "Supposed":
        """Return the supposition with two joints exchanged in some orders."""
        changed: dict[str, Any] = {}
        for field in fields:
            order = list(getattr(self, field))
            order[i], order[j] = order[j], order[i]
            changed[field] = tuple(order)
        return replace(self, **changed)


def nothing_supposed(n: int) -> Supposed:
    """Return that a recording of n joints is as it says."""
    order = tuple(range(n))
    return Supposed((1.0,) * n, (0.0,) * n, order, order, (1.0,) * n, (0,) * n)


class Beside(NamedTuple):
    """Prior of the columns beside the links, (k,) each."""

    mean: Floats
    std: Floats
    joint: np.ndarray  # whose torque's size they have, -1 for none
    power: Floats  # that each takes per unit, if it is friction: all of a joint together take power

    def and_columns(self, mean: Sequence[float], std: Sequence[float]) -> "Beside":
        """Return the prior with more columns behind, that are no joint's friction."""
        none = np.full(len(mean), -1)
        more = (mean, std, none, 0.0 * none)
        return Beside(*(np.concatenate([had, new]) for had, new in zip(self, more, strict=True)))


class Rows:
    """Some rows of a recording."""

    def __init__(self, model: RobotModel, samples: Samples, count: int, *, identified: bool = False) -> None:
        """Take rows (count at most) that lie evenly along a recording."""
        total, self.still = len(samples), not samples.qd.any()
        self.model, self.samples, self.identified = model, samples, identified
        ends = 0.0 if self.still else _ENDS_SHARE
        first, last = ends * (total - 1), (1.0 - ends) * (total - 1)
        self.at = np.unique(np.linspace(first, last, min(count, total)).astype(np.int64))
        self.step = float(np.median(np.diff(samples.time))) if total > 1 else 1.0
        self.few = samples.rows(np.isin(np.arange(total), self.at), samples.name)
        self.measured, self.known = samples.tau + samples.known, self.few.known
        size = np.sqrt(np.mean(self.measured[self.at] ** 2, axis=0))
        self.size = np.maximum(size, _LEAST_TORQUE * max(float(size.max()), 1e-12))  # (n,) [Nm or N]
        self.parameters = Parameters(model, "static" if self.still else "full")
        self.has_springs = any(term.kind == "spring" for term in self.parameters.actuation)
        self.carried = np.zeros_like(self.known)  # (N, n) what links ask, by a first fit; measured, it explains itself
        self._friction: dict[tuple[object, ...], Floats] = {}

    def __len__(self) -> int:
        return len(self.at)

    @cached_property
    def velocity_faults(self) -> list[VelocityFault]:
        """What is likelier than sound velocities."""
        return self.samples.velocity_faults(self.model)

    @cached_property
    def shown(self) -> Floats:
        """The combinations (L, r) of the links' parameters that torques can show, under any gravity."""
        rng, n = np.random.default_rng(0), self.model.n
        q, qd, qdd = rng.uniform(-2.0, 2.0, (3, _DRAWN_ROWS, n)) * np.array([1.0, *[not self.still] * 2])[:, None, None]
        down = STANDARD_GRAVITY * rng.normal(size=(_DRAWN_ROWS, 3))
        Y = torque_regressor(self.model, q, qd, qdd, down)[:, :, self._own].reshape(-1, len(self._own))
        _, sizes, Vt = np.linalg.svd(Y, full_matrices=False)
        return np.asarray(Vt[sizes > _VISIBLE_RATIO * sizes[0]].T)

    @cached_property
    def _own(self) -> list[int]:
        return [PER_LINK * link + p for link in self.parameters.links for p in range(PER_LINK)]

    def motion(self, supposed: Supposed) -> tuple[Floats, Floats, Floats]:
        """Return the arm's positions, velocities and accelerations (N, n)."""
        order, sign = list(supposed.position_order), np.array(supposed.signs)
        q, qd, qdd = (values[:, order] * sign for values in (self.few.q, self.few.qd, self.few.qdd))
        if supposed.derived and self.few.derived is not None:
            joints, derived = list(supposed.derived), self.few.derived[:, :, order] * sign
            qd[:, joints], qdd[:, joints] = derived[:, 0, joints], derived[:, 1, joints]
        return q - np.array(supposed.zeros), qd, qdd

    def links(self, supposed: Supposed) -> Floats:
        """Return the columns (N, n, L) of the links' parameters."""
        *_, down, base = self.few.motion()
        gravity = down if supposed.gravity is None else np.array(supposed.gravity)
        return torque_regressor(self.model, *self.motion(supposed), gravity, base)[:, :, self._own]

    def torques(self, supposed: Supposed) -> Floats:
        """Return recorded torques (N, n) in the joints' order, a delay taken out."""
        at = np.clip(self.at[:, None] + supposed.late, 0, len(self.measured) - 1)
        torque = self.measured[at, list(supposed.torque_order)]
        for joint, after in supposed.turned:
            torque[self.samples.time[self.at] > after, joint] *= -1.0
        return torque

    def term_loads(self, supposed: Supposed) -> Floats:
        """Return the loads (N, t) of the robot file's friction, rotors and springs, as friction remembers its path."""
        terms = self.parameters.actuation
        joints = list(supposed.derived or ())
        key = supposed.signs, supposed.position_order, supposed.derived, supposed.zeros if self.has_springs else ()
        if key not in self._friction:
            order, sign = list(supposed.position_order), np.array(supposed.signs)
            history, smooth = self.few.history, self.model.assumed_actuation.coulomb_velocity
            if history is not None:
                segments = [(q[:, order] * sign, qd[:, order] * sign, cut) for q, qd, cut in history.segments]
                for q, qd, _ in segments:
                    qd[:, joints] = np.gradient(q[:, joints], self.step, axis=0)
                history = replace(history, segments=tuple(segments))
            q, qd, qdd = self.motion(supposed)
            few = replace(self.few, q=q, qd=qd, qdd=qdd, history=history)
            slow = max(smooth, min(_SLOW[unit] for unit in self.model.joint_units))
            loads = [recorded_load(term, few, slow) for term in terms]
            self._friction[key] = np.column_stack(loads) if loads else np.zeros((len(few), 0))
        return self._friction[key]

    def beside(self, supposed: Supposed) -> tuple[Floats, Beside, int]:
        """Return the columns (N, n, k) beside the links, their prior, and how many are the robot file's own."""
        carried = np.abs(self.carried[:, list(supposed.torque_order)])
        n, (_, qd, qdd) = self.model.n, self.motion(supposed)
        size, eye = self.size[list(supposed.torque_order)], np.eye(n)
        entries = list[tuple[Floats, float, float, int, float]]()  # column, mean, deviation, joint, power

        def add(load: Floats, along: Floats, share: float, mean: float = 0.0, rubs: bool = False) -> None:
            joint = int(np.argmax(np.abs(along)))
            power = float(np.mean(load * (qd @ along))) if rubs else 0.0
            entries.append((load[:, None] * along, mean * share * size[joint], share * size[joint], joint, power))

        terms = self.parameters.actuation
        for term, load in zip(terms, self.term_loads(supposed).T, strict=True):
            constant = term.kind in ("coulomb", "offset")
            share = _COULOMB_SHARE if constant else _TERM_SHARE / _spread(load)
            rubs = term.friction is not None and not term.friction.at_rest
            add(load, term.combination, share, 0.5 if term.kind in ("coulomb", "viscous") else 0.0, rubs)
        geared = {i for term in terms if term.kind == "motor_inertia" for i in np.flatnonzero(term.combination)}
        if not self.still:
            for i in range(n):
                if i not in geared and not self.identified:
                    add(qdd[:, i], eye[i], ROTOR_SHARE / _spread(qdd[:, i]))
            slow = np.array([_SLOW[unit] for unit in self.model.joint_units])
            direction = np.tanh(qd / slow)
            for i in range(n):
                stribeck = direction[:, i] * np.exp(-((qd[:, i] / slow[i] / _STRIBECK_RATIO) ** 2))
                add(stribeck, eye[i], _STRIBECK_SHARE, rubs=True)
                add(direction[:, i] * carried[:, i] / size[i], eye[i], _LOADED_SHARE, rubs=True)
                square = qd[:, i] * np.abs(qd[:, i])
                add(square, eye[i], _QUADRATIC_SHARE / _spread(square), rubs=True)
            for i, j, sign in supposed.shared:
                along, rate = eye[i] + sign * eye[j], qd[:, i] + sign * qd[:, j]
                for load in (np.tanh(rate / slow[i]), rate):
                    add(load, along, _SHARED_SHARE / _spread(load), rubs=True)
                crossed = qdd[:, [j]] * eye[i] + qdd[:, [i]] * eye[j]
                entries.append((crossed, 0.0, _SHARED_ROTOR_SHARE * size[i] / _spread(qdd[:, j]), i, 0.0))
        for one in supposed.added:
            for column, std in zip(self.added(one, supposed).transpose(2, 0, 1), one.sizes, strict=True):
                entries.append((column, 0.0, std, one.joint, 0.0))
        columns, *prior = zip(*entries, strict=True)
        return np.stack(columns, axis=2), Beside(*map(np.array, prior)), len(terms)

    def added(self, one: Added, supposed: Supposed) -> Floats:
        """Return the columns (N, n, k) of what is added to torques, per unit."""
        _, qd, _ = self.motion(supposed)
        if one.shape == "load":
            place = PER_LINK * self.parameters.links.index(self.model.frame().link)
            columns = self.links(supposed)[:, :, place : place + PER_LINK]
        else:
            v, slow = qd[:, one.joint], _SLOW[self.model.joint_units[one.joint]]
            loads = {
                "zero": [np.ones(len(v))],
                "drift": [np.linspace(0.0, 1.0, len(v))],
                "friction": [np.tanh(v / slow), v],
            }[one.shape]
            columns = np.eye(self.model.n)[one.joint][:, None] * np.column_stack(loads)[:, None]
        return columns if one.after is None else columns * (self.samples.time[self.at] > one.after)[:, None, None]


def _spread(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) + 1e-9


def side_by_side(parts: Sequence[Floats]) -> Floats:
    """Return columns (N, n, k) side by side."""
    return np.concatenate(parts, axis=2)
