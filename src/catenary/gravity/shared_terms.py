"""Entries that are too long to be written out, in terms that are defined once and that several entries share.

From link to link a vector is turned back by the joint between them. So gravity as a link's frame sees it, and the
moment z x gravity of a coordinate's joints that it sees, take a short sum of the ones of the link before, whatever the
twists: gamma_i = R_i^T gamma_p, u_ri = R_i^T u_rp + c_ir z_i x gamma_i, with c_ir the part of coordinate r in joint i.
An entry of the regressor is a part of u: -gravity . (z x e) = e . (z x gravity).
"""

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.regressor import CARRIED_MASS
from catenary.gravity.terms import (
    SymbolicVector,
    Terms,
    Turn,
    angle_atom,
    constant_vector,
    crossed,
    multiplied,
    named_atom,
    scaled,
    sum_of,
    times,
    turned,
)
from catenary.robots.model import RobotModel


class SharedTerms:
    """Vectors of a robot under one gravity, each part of them written once, in `definitions`."""

    def __init__(self, model: RobotModel, gravity: Floats) -> None:
        """Take a robot, and gravity (3,), a constant."""
        self.definitions: dict[str, Terms] = {}  # by name, each in terms of names before it
        self._model = model
        self._base = constant_vector(gravity)
        self._gravity: dict[int, SymbolicVector] = {}
        self._moments: dict[tuple[int, int], SymbolicVector] = {}

    def entry(self, row: int, link: int, along: int) -> Terms:
        """Return what a first moment along an axis of a link, or the mass its joint carries, asks of a coordinate."""
        moment = self._moment(row, link)
        if along != CARRIED_MASS:
            return moment[along]
        tree = self._model.tree
        axis = tree.axis[link]
        arm = self._along(axis, moment)
        x, sign = angle_atom("q", self._model.coupling[link])
        turning = sum_of(scaled(multiplied(arm, x), sign), scaled(arm, float(self._model.offset[link])))
        sliding = self._along(axis, self._gravity_at(link))
        return sum_of(turning, scaled(sliding, -float(self._model.coupling[link, row])))

    def _along(self, axis: Floats, vector: SymbolicVector) -> Terms:
        total: Terms = {}
        for part, terms in zip(axis, vector, strict=True):
            total = sum_of(total, scaled(terms, float(part)))
        return total

    def _gravity_at(self, link: int) -> SymbolicVector:
        if link < 0:
            return self._base
        if link not in self._gravity:
            parent = self._gravity_at(int(self._model.tree.parent[link]))
            self._gravity[link] = self._named(rf"\gamma_{{{link + 1},%s}}", self._seen_from(link, parent))
        return self._gravity[link]

    def _moment(self, row: int, link: int) -> SymbolicVector:
        if link < 0:
            return {}, {}, {}
        if (row, link) not in self._moments:
            tree, weight = self._model.tree, float(self._model.coupling[link, row])
            vector = self._seen_from(link, self._moment(row, int(tree.parent[link])))
            if weight != 0.0 and not tree.prismatic[link]:
                own = crossed(tree.axis[link], self._gravity_at(link))
                x, y, z = (sum_of(a, scaled(b, weight)) for a, b in zip(vector, own, strict=True))
                vector = x, y, z
            self._moments[row, link] = self._named(f"u_{{{row + 1},{link + 1},%s}}", vector)
        return self._moments[row, link]

    def _seen_from(self, link: int, vector: SymbolicVector) -> SymbolicVector:
        """Return a vector of the parent's frame in a link's own."""
        tree = self._model.tree
        here = times(tree.rotation[link].T, vector)
        if tree.prismatic[link]:
            return here
        angle = np.array(self._model.coupling[link]), float(self._model.offset[link])
        return turned(Turn(np.eye(3), tree.axis[link], angle), here, back=True)

    def _named(self, name: str, vector: SymbolicVector) -> SymbolicVector:
        """Give each part of a vector that has several terms a name."""
        parts: list[Terms] = []
        for letter, terms in zip("xyz", vector, strict=True):
            if len(terms) > 1:
                self.definitions[name % letter] = terms
                parts.append({(named_atom(name % letter),): 1.0})
            else:
                parts.append(terms)
        return parts[0], parts[1], parts[2]
