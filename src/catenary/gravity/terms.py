"""Sums of products of sines and cosines, such as c1 c23 - 0.5 s1: their algebra, and how they are written."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats

SHORT = 3  # terms; longer entries are called by a name
MOST = 64  # terms on the way; an entry that needs more is not written out
ROUNDING = 1e-12

# "c", "s" or "q" of a sum of factors times coordinates; without factors a name
Atom = tuple[str, tuple[tuple[int, float], ...]]
Terms = dict[tuple[Atom, ...], float]  # product of atoms, in order -> coefficient
SymbolicVector = tuple[Terms, Terms, Terms]


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


def named_atom(name: str) -> Atom:
    """Return an atom that stands for what is written elsewhere under this name."""
    return name, ()


def constant_vector(v: Floats) -> SymbolicVector:
    """Return a vector (3,) of numbers."""
    return cleaned({(): float(v[0])}), cleaned({(): float(v[1])}), cleaned({(): float(v[2])})


def times(matrix: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a matrix (3, 3) of numbers times a vector."""
    rows = []
    for r in range(3):
        total: Terms = {}
        for k in range(3):
            total = sum_of(total, scaled(v[k], float(matrix[r, k])))
        rows.append(total)
    return rows[0], rows[1], rows[2]


def crossed(a: Floats, v: SymbolicVector) -> SymbolicVector:
    """Return a x v of a vector (3,) of numbers."""
    return times(np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]]), v)


def dotted(a: SymbolicVector, b: SymbolicVector) -> Terms:
    """Return a . b, multiplied out.

    Raises:
        TooLongError: It has more than 64 terms.
    """
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
    """Add two sums.

    Raises:
        TooLongError: More than `most` terms remain; None for as many as there are.
    """
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
