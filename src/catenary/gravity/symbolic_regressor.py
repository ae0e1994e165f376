"""Entries of the gravity regressor written out: sums of products of sines and cosines, such as c1 c23 - 0.5 s1.

Before a link lie turns about axes, with constant rotations between them. Joints with parallel axes in a row make one
turn, by the sum of their angles, and a turn leaves its own axis alone. So gravity is turned on from turn to turn, and
what each joint adds where its turn starts, z x gravity: each sine and cosine comes at most once in a term, and like
terms cancel. Sums that are too long are left out, or written in terms that several share and that have names.
"""

from functools import reduce
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.gravity_regressor import CARRIED_MASS
from catenary.robots.model import RobotModel

SHORT_TERMS = 3  # terms; longer entries are called by a name
MAX_TERMS = 64  # terms on the way; an entry that needs more is not written out
_ROUNDING = 1e-12

# "c", "s" or "q" of a sum of factors times coordinates; without factors a name
Atom = tuple[str, tuple[tuple[int, float], ...]]
Terms = dict[tuple[Atom, ...], float]  # product of atoms, in order -> coefficient
Written = Terms | None  # None for what is too long
SymbolicVector = tuple[Written, Written, Written]
Angle = tuple[Floats, float]  # (n,) factors of the coordinates, offset [rad]


def rotated_back(axis: Floats, angle: Angle, v: SymbolicVector) -> SymbolicVector:
    """Return a symbolic vector turned back about an axis, by Rodrigues' formula u u.v + c (v - u u.v) - s u x v.

    Args:
        axis, v: Unit vector u (3,), and vector of symbolic components.
        angle: Factors of the joint angles, and a constant [rad].
    """
    factors, offset = angle
    along = times(np.outer(axis, axis), v)
    across = times(np.eye(3) - np.outer(axis, axis), v)
    sideways = crossed(-axis, v)
    cosine, sine = np.cos(offset), np.sin(offset)
    moving = bool(np.abs(factors).max(initial=0.0) > _ROUNDING)
    c, (s, sign) = angle_atom("c", factors)[0], angle_atom("s", factors)
    out = []
    for k in range(3):
        # the offset's own sine and cosine: cos(a + o) = cos a cos o - sin a sin o, and so on
        with_c = sum_of(scaled(across[k], cosine), scaled(sideways[k], sine))
        with_s = sum_of(scaled(across[k], -sine), scaled(sideways[k], cosine))
        turning = sum_of(multiplied(with_c, c), scaled(multiplied(with_s, s), sign)) if moving else with_c
        out.append(sum_of(along[k], turning))
    return out[0], out[1], out[2]


def angle_atom(kind: str, factors: Floats) -> tuple[Atom, float]:
    """Return the atom of an angle whose first factor is positive, and the sign that a sine then has."""
    nonzero = [(k, float(f)) for k, f in enumerate(factors) if abs(f) > _ROUNDING]
    sign = -1.0 if nonzero and nonzero[0][1] < 0.0 else 1.0
    return (kind, tuple((k, round(sign * f, 12)) for k, f in nonzero)), sign


def times(matrix: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a matrix (3, 3) of numbers times a vector."""
    x, y, z = (weighted(row, v) for row in matrix)
    return x, y, z


def weighted(weights: Floats, v: SymbolicVector) -> Written:
    """Return the scalar product of numbers (3,) and a vector."""
    return reduce(sum_of, (scaled(terms, float(weight)) for weight, terms in zip(weights, v, strict=True)))


def crossed(a: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a x v of a vector (3,) of numbers."""
    return times(np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]]), v)


def sum_of(a: Written, b: Written) -> Written:
    """Add two sums."""
    if a is None or b is None:
        return None
    total = cleaned(a | {atoms: a.get(atoms, 0.0) + value for atoms, value in b.items()})
    return total if len(total) <= MAX_TERMS else None


def scaled(terms: Written, factor: float) -> Written:
    """Return a number times a sum."""
    if abs(factor) <= _ROUNDING:
        return {}
    return terms and cleaned({atoms: factor * value for atoms, value in terms.items()})


def multiplied(terms: Written, atom: Atom) -> Written:
    """Return a sum times an atom."""
    return terms and {tuple(sorted((*atoms, atom))): value for atoms, value in terms.items()}


def cleaned(terms: Terms) -> Terms:
    """Return a sum without what is left by rounding."""
    return {atoms: value for atoms, value in terms.items() if abs(value) > _ROUNDING}


def terms_text(terms: Terms, *, latex: bool = False) -> str:
    """Write a sum of products: c1 c23 - 0.5 s1."""
    text = ""
    for atoms, value in sorted(terms.items(), key=lambda item: (len(item[0]), item[0])):
        names = " ".join(_atom_text(atom, latex=latex) for atom in atoms)
        size = f"{abs(value):.6g}"
        word = names if names and size == "1" else f"{size} {names}".rstrip()
        sign = "-" if value < 0.0 else "+"
        text += f" {sign} {word}" if text else f"-{word}" if value < 0.0 else word
    return text or "0"


def _atom_text(atom: Atom, *, latex: bool) -> str:
    kind, factors = atom
    if not factors:
        return kind
    if kind == "q":
        name = _angle_text(factors, latex=latex)
        return name if len(factors) == 1 and factors[0][1] == 1.0 else f"({name})"
    # c12 is of joints 1 and 2: of joint 12 alone it is c(q12)
    if all(factor == 1.0 for _, factor in factors) and (len(factors) > 1 or factors[0][0] <= 8):
        index = ("," if any(k > 8 for k, _ in factors) else "").join(str(k + 1) for k, _ in factors)
        return f"{kind}_{{{index}}}" if latex else f"{kind}{index}"
    name = {"c": r"\cos", "s": r"\sin"}[kind] if latex else kind
    return f"{name}({_angle_text(factors, latex=latex)})"


def _angle_text(factors: tuple[tuple[int, float], ...], *, latex: bool) -> str:
    text = ""
    for k, factor in factors:
        size = f"{abs(factor):.6g}"
        name = f"{'' if size == '1' else size + ' '}q{f'_{{{k + 1}}}' if latex else k + 1}"
        text += (("-" if factor < 0.0 else "+") if text or factor < 0.0 else "") + name
    return text


class Turn(NamedTuple):
    """The last turn before a link's frame."""

    first: int  # joint that begins it; -1 before any
    joints: tuple[tuple[int, float], ...]  # that turn so, and the signs of their axes
    angle: Angle
    after: Floats  # (3, 3) constant rotation behind it


class WrittenTerms:
    """What masses and first moments of a robot's links ask of its coordinates under a constant gravity.

    Where they are `shared`, the parts of what turns on have names, `definitions`.
    """

    def __init__(self, model: RobotModel, gravity: Floats, *, shared: bool = False) -> None:
        """Take a robot, and gravity (3,), such as (0, 0, -1) for a level base, in units of the free fall."""
        self.definitions: dict[str, Terms] = {}  # by name, each in terms of names before it
        x, y, z = (cleaned({(): float(part)}) for part in gravity)
        self._model, self._gravity, self._shared = model, (x, y, z), shared
        self._ahead: dict[tuple[int | None, int], SymbolicVector] = {}
        self._turns = {-1: Turn(-1, (), (np.zeros(model.n), 0.0), np.eye(3))}
        for link in range(len(model.tree.parent)):
            self._turns[link] = self._turn_before(link)

    def entry(self, row: int, link: int, along: int) -> Written:
        """Write what a first moment along an axis of a link, or the mass its joint carries, asks of a coordinate."""
        moment = self.seen_from(link, row)
        if along != CARRIED_MASS:
            return moment[along]
        # the joint moves the mass along its axis, and gravity pulls along that
        axis, weight = self._model.tree.axis[link], float(self._model.coupling[link, row])
        arm, (x, sign) = weighted(axis, moment), angle_atom("q", self._model.coupling[link])
        turning = sum_of(scaled(multiplied(arm, x), sign), scaled(arm, float(self._model.offset[link])))
        return sum_of(turning, scaled(weighted(axis, self.seen_from(link)), -weight))

    def seen_from(self, link: int, row: int | None = None) -> SymbolicVector:
        """Return gravity in a link's frame, or what a first moment along each axis there asks of a coordinate."""
        first, joints, angle, after = self._turns[link]
        vector = self._before_turn(first, row)
        if first < 0:
            return times(after.T, vector)
        axis = self._model.tree.axis[first]
        if row is not None:
            weight = sum(sign * float(self._model.coupling[joint, row]) for joint, sign in joints)
            own = crossed(weight * axis, self._before_turn(first))
            x, y, z = (sum_of(a, b) for a, b in zip(vector, own, strict=True))
            vector = x, y, z
        return times(after.T, rotated_back(axis, angle, vector))

    def _before_turn(self, first: int, row: int | None = None) -> SymbolicVector:
        """Return gravity, or what it asks of a coordinate by joints before, in the frame that a turn starts from."""
        if first < 0:
            return self._gravity if row is None else ({}, {}, {})
        if (row, first) not in self._ahead:
            tree = self._model.tree
            vector = times(tree.rotation[first].T, self.seen_from(int(tree.parent[first]), row))
            name = rf"\gamma_{{{first + 1},%s}}" if row is None else f"u_{{{row + 1},{first + 1},%s}}"
            self._ahead[row, first] = self._named(name, vector) if self._shared else vector
        return self._ahead[row, first]

    def _turn_before(self, link: int) -> Turn:
        tree = self._model.tree
        first, joints, angle, after = last = self._turns[int(tree.parent[link])]
        after = after @ tree.rotation[link]
        if tree.prismatic[link]:
            return last._replace(after=after)
        own, z = (np.array(self._model.coupling[link]), float(self._model.offset[link])), after @ tree.axis[link]
        if first < 0 or np.linalg.norm(np.cross(tree.axis[first], z)) >= 1e-9:
            return Turn(link, ((link, 1.0),), own, np.eye(3))
        sign = 1.0 if tree.axis[first] @ z > 0.0 else -1.0
        whole = angle[0] + sign * own[0], angle[1] + sign * own[1]
        return Turn(first, (*joints, (link, sign)), whole, after)

    def _named(self, name: str, vector: SymbolicVector) -> SymbolicVector:
        parts: list[Written] = []
        for letter, terms in zip("xyz", vector, strict=True):
            if terms is not None and len(terms) > 1:
                self.definitions[name % letter] = terms
                terms = {((name % letter, ()),): 1.0}  # an atom that stands for what is written elsewhere
            parts.append(terms)
        return parts[0], parts[1], parts[2]
