"""Entries of the gravity regressor written out: sums of products of sines and cosines, such as c1 c23 - 0.5 s1.

Between a joint k and a link j it carries lie turns about axes, with constant rotations between them. Joints with
parallel axes in a row make one turn, by the sum of their angles, and a turn leaves its own axis alone. So an entry
-gravity . (z_k x e), e an axis of frame j, is the product of gravity turned as far as the turn that joint k belongs
to, and of e turned back as far as there: each sine and cosine comes at most once in a term, and like terms cancel.

Entries that are too long are written in terms that several share, `SharedTerms`.
"""

from functools import reduce
from typing import NamedTuple, TypeVar

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.gravity_regressor import CARRIED_MASS
from catenary.robots.model import RobotModel

SHORT = 3  # terms; longer entries are called by a name
MOST = 64  # terms on the way; an entry that needs more is not written out
ROUNDING = 1e-12

# "c", "s" or "q" of a sum of factors times coordinates; without factors a name
Atom = tuple[str, tuple[tuple[int, float], ...]]
Terms = dict[tuple[Atom, ...], float]  # product of atoms, in order -> coefficient
SymbolicVector = tuple[Terms, Terms, Terms]
Written = TypeVar("Written", Terms, SymbolicVector)


class TooLongError(Exception):
    """An entry has too many terms on the way."""


class Turn(NamedTuple):
    """A rotation about a constant axis, after a constant rotation of the frame."""

    before: Floats  # (3, 3)
    axis: Floats  # (3,)
    angle: tuple[Floats, float]  # (n,) factors of the coordinates, offset [rad]


def turned(turn: Turn, v: SymbolicVector, *, back: bool) -> SymbolicVector:
    """Turn a vector by Rodrigues' formula, u u.v + c (v - u u.v) + s u x v, or back."""
    u = turn.axis
    factors, offset = turn.angle
    along = times(np.outer(u, u), v)
    across = times(np.eye(3) - np.outer(u, u), v)
    sideways = crossed(-u if back else u, v)
    cosine, sine = np.cos(offset), np.sin(offset)
    moving = bool(np.abs(factors).max(initial=0.0) > ROUNDING)
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
    nonzero = [(k, float(f)) for k, f in enumerate(factors) if abs(f) > ROUNDING]
    sign = -1.0 if nonzero and nonzero[0][1] < 0.0 else 1.0
    return (kind, tuple((k, round(sign * f, 12)) for k, f in nonzero)), sign


def constant_vector(v: Floats) -> SymbolicVector:
    """Return a vector (3,) of numbers."""
    x, y, z = (cleaned({(): float(part)}) for part in v)
    return x, y, z


def times(matrix: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a matrix (3, 3) of numbers times a vector."""
    x, y, z = (weighted(row, v) for row in matrix)
    return x, y, z


def weighted(weights: Floats, v: SymbolicVector) -> Terms:
    """Return the scalar product of numbers (3,) and a vector."""
    return reduce(sum_of, (scaled(terms, float(weight)) for weight, terms in zip(weights, v, strict=True)))


def crossed(a: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a x v of a vector (3,) of numbers."""
    return times(np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]]), v)


def dotted(a: SymbolicVector, b: SymbolicVector) -> Terms:
    """Return a . b, multiplied out."""
    total: Terms = {}
    for k in range(3):
        for left, x in a[k].items():
            for right, y in b[k].items():
                product = tuple(sorted(left + right))
                total[product] = total.get(product, 0.0) + x * y
                if len(total) > MOST:
                    raise TooLongError
    return cleaned(total)


def sum_of(a: Terms, b: Terms, *, most: int | None = MOST) -> Terms:
    """Add two sums."""
    total = dict(a)
    for atoms, value in b.items():
        total[atoms] = total.get(atoms, 0.0) + value
    if most is not None and len(total) > most:
        raise TooLongError
    return cleaned(total)


def scaled(terms: Terms, factor: float) -> Terms:
    """Return a number times a sum."""
    return cleaned({atoms: factor * value for atoms, value in terms.items()})


def multiplied(terms: Terms, atom: Atom) -> Terms:
    """Return a sum times an atom."""
    return {tuple(sorted((*atoms, atom))): value for atoms, value in terms.items()}


def cleaned(terms: Terms) -> Terms:
    """Return a sum without what is left by rounding."""
    return {atoms: value for atoms, value in terms.items() if abs(value) > ROUNDING}


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


class Way(NamedTuple):
    """The way from the base to one link."""

    turns: list[Turn]
    end: Floats  # (3, 3) constant rotation after the last turn
    joints: dict[int, tuple[int, Floats]]  # joint -> its turn (-1 before the first), and its axis there


def moment_entries(model: RobotModel, link: int, axis: Floats, gravity: Floats) -> list[Terms | None]:
    """Write what a first moment along an axis (3,) of a link asks of each coordinate; None for what is too long.

    gravity (3,) is a constant, such as (0, 0, -1) for a level base, in units of the free fall.
    """
    way = way_to(model, link)
    down = _before_turns(way, constant_vector(gravity), of_base=True)
    seen = _before_turns(way, constant_vector(way.end @ axis), of_base=False)
    entries: list[Terms | None] = []
    for row in range(model.n):
        total: Terms = {}
        try:
            for joint, (turn, z) in way.joints.items():
                weight = float(model.coupling[joint, row])
                if weight != 0.0 and not model.tree.prismatic[joint]:  # -weight gravity . (z x e)
                    held = dotted(_short(down[turn]), crossed(z, _short(seen[turn])))
                    total = sum_of(total, scaled(held, -weight))
            entries.append(total)
        except TooLongError:
            entries.append(None)
    return entries


def mass_entries(model: RobotModel, link: int, gravity: Floats) -> list[Terms | None]:
    """Write what the mass that a prismatic joint carries asks of each coordinate; None for what is too long."""
    axis, way = model.tree.axis[link], way_to(model, link)
    down, slides = constant_vector(gravity), constant_vector(way.end @ axis)
    ahead = [*_before_turns(way, down, of_base=True), down][0]  # where the first turn, if any, starts from
    seen = [*_before_turns(way, slides, of_base=False), slides][0]
    entries: list[Terms | None] = []
    for row, moment in enumerate(moment_entries(model, link, axis, gravity)):
        try:
            own = dotted(_short(ahead), _short(seen)) if model.coupling[link, row] else {}
            entries.append(_of_mass(model, row, link, _short(moment), own))
        except TooLongError:
            entries.append(None)
    return entries


def _of_mass(model: RobotModel, row: int, link: int, arm: Terms, own: Terms) -> Terms:
    """Return what a joint's mass asks of a coordinate, by what a moment along its axis asks, and gravity along that."""
    x, sign = angle_atom("q", model.coupling[link])
    turning = sum_of(scaled(multiplied(arm, x), sign), scaled(arm, float(model.offset[link])))
    return sum_of(turning, scaled(own, -float(model.coupling[link, row])))


def _short(written: Written | None) -> Written:
    """Return what could be written out."""
    if written is None:
        raise TooLongError
    return written


def way_to(model: RobotModel, link: int) -> Way:
    """Return the way from the base to a link; joints with parallel axes in a row make one turn."""
    tree = model.tree
    path = [link]
    while tree.parent[path[0]] >= 0:
        path.insert(0, int(tree.parent[path[0]]))
    turns: list[Turn] = []
    joints: dict[int, tuple[int, Floats]] = {}
    constant = np.eye(3)
    for i in path:
        constant = constant @ tree.rotation[i]
        z = constant @ tree.axis[i]
        if tree.prismatic[i]:
            joints[i] = (len(turns) - 1, z)
            continue
        angle = (np.array(model.coupling[i]), float(model.offset[i]))
        if turns and np.linalg.norm(np.cross(turns[-1].axis, z)) < 1e-9:
            before, axis, (factors, offset) = turns[-1]
            sign = 1.0 if axis @ z > 0.0 else -1.0
            turns[-1] = Turn(before, axis, (factors + sign * angle[0], offset + sign * angle[1]))
            joints[i] = (len(turns) - 1, sign * axis)
        else:
            turns.append(Turn(constant, tree.axis[i], angle))
            constant = np.eye(3)
            joints[i] = (len(turns) - 1, tree.axis[i])
    return Way(turns, constant, joints)


def _before_turns(way: Way, v: SymbolicVector, *, of_base: bool) -> list[SymbolicVector | None]:
    """Return a vector of the base, or of the way's end, in the frame that each turn starts from; None if too long."""
    out: list[SymbolicVector | None] = [None] * len(way.turns)
    try:
        for k in range(len(out))[:: 1 if of_base else -1]:
            turn = way.turns[k]
            out[k] = here = times(turn.before.T, v) if of_base else turned(turn, v, back=False)
            v = turned(turn, here, back=True) if of_base else times(turn.before, here)
    except TooLongError:
        pass
    return out


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
        axis = self._model.tree.axis[link]
        return _of_mass(self._model, row, link, weighted(axis, moment), weighted(axis, self._gravity_at(link)))

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
                parts.append({((name % letter, ()),): 1.0})  # an atom that stands for what is written elsewhere
            else:
                parts.append(terms)
        return parts[0], parts[1], parts[2]
