"""Gravity parameters as expressions in a robot's symbols: unknown masses and centres of mass, known lengths.

Links are numbered from 1 in the tree's order. m2 is link 2's mass; lg2 (lg2x, lg2y, lg2z where it may lie on several
axes) its centre of mass in its frame; l2 the step from frame 2 to the next one along the only axis that it has, l2x its
part along x where it has several, l2,5x that to link 5 where several links hang on link 2. Lengths are signed.
Two expressions are the same parameter if they are the same sum of products; no number of the model is looked at, but
that steps of zero length and the masses of links declared massless are zero.
"""

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from catenary.gravity.gravity_regressor import carried_links
from catenary.robots.model import RobotModel

_NO_LENGTH_M = 1e-12  # [m]


class Product(NamedTuple):
    """A length times the sum of some links' masses; no length stands for the masses alone."""

    length: str
    masses: tuple[int, ...]  # indices of links


Expression = tuple[Product, ...]


class NamedSymbol(NamedTuple):
    """What a symbol stands for, and its value where the model has one."""

    meaning: str
    value: float | None


def moment_expression(model: RobotModel, link: int, axis: int) -> Expression:
    """Return the first moment, along an axis of its frame, of a link with all it carries lumped at its joints."""
    products = []
    for child in np.flatnonzero(model.tree.parent == link).tolist():
        masses = carried_masses(model, child)
        if masses and abs(model.tree.origin[child, axis]) > _NO_LENGTH_M:
            products.append(Product(_step_name(model, child, axis), masses))
    if _has_mass(model, link) and model.axes_of_com[link, axis]:
        products.append(Product(_com_name(model, link, axis), (link,)))
    return tuple(products)


def mass_expression(model: RobotModel, link: int) -> Expression:
    """Return the mass that a link's joint carries."""
    masses = carried_masses(model, link)
    return (Product("", masses),) if masses else ()


def monomials(expression: Expression) -> frozenset[tuple[str, int]]:
    """Return an expression multiplied out; all its terms differ, so equal sets are equal expressions."""
    return frozenset((product.length, link) for product in expression for link in product.masses)


def expression_text(expression: Expression, *, latex: bool = False) -> str:
    """Write an expression as the paper does: l1 (m2+m3) + lg1 m1."""
    parts = []
    for length, masses in expression:
        name, index = length.rstrip("0123456789,xyz"), length.lstrip("lg")
        symbol = length if not latex else f"l_{{{'g' if name == 'lg' else ''}{index}}}"
        total = "+".join((f"m_{{{word}}}" if latex else f"m{word}") for word in _mass_words(masses))
        total = total.replace("m_{...}" if latex else "m...", r"\dots" if latex else "...")
        parts.append(f"{symbol} ({total})" if length and len(masses) > 1 else f"{symbol} {total}" if length else total)
    return " + ".join(parts) or "0"


def symbols_of(model: RobotModel, expressions: Sequence[Expression]) -> dict[str, NamedSymbol]:
    """Return what the symbols in expressions stand for, in the order of links: masses, lengths, centres of mass."""
    used = {name for expression in expressions for name, _ in expression}
    massive = sorted({link for expression in expressions for _, masses in expression for link in masses})
    known = not model.missing_inertia
    table = {
        f"m{link + 1}": NamedSymbol(
            f"mass of {model.link_names[link]} [kg]", float(model.tree.mass[link]) if known else None
        )
        for link in massive
    }
    for child, axis in np.ndindex(len(model.link_names), 3):
        step, above = float(model.tree.origin[child, axis]), int(model.tree.parent[child])
        if above >= 0 and abs(step) > _NO_LENGTH_M and (name := _step_name(model, child, axis)) in used:
            parent = model.link_names[above]
            meaning = f"from {parent} to {model.link_names[child]}, along {'xyz'[axis]} of {parent} [m]"
            table[name] = NamedSymbol(meaning, step)
    for link, axis in np.ndindex(len(model.link_names), 3):
        if model.axes_of_com[link, axis] and (name := _com_name(model, link, axis)) in used:
            meaning = f"centre of mass of {model.link_names[link]}, along {'xyz'[axis]} [m]"
            table[name] = NamedSymbol(meaning, float(model.tree.com[link, axis]) if known else None)
    return table


def carried_masses(model: RobotModel, joint: int) -> tuple[int, ...]:
    """Return the links with mass that a joint carries."""
    return tuple(sorted(link for link in carried_links(model.tree, joint) if _has_mass(model, link)))


def _has_mass(model: RobotModel, link: int) -> bool:
    """Return whether a link may have mass: only one that is declared massless has none."""
    return model.link_names[link] not in model.massless


def _step_name(model: RobotModel, child: int, axis: int) -> str:
    parent = int(model.tree.parent[child])
    others = np.count_nonzero(model.tree.parent == parent) > 1
    several = np.count_nonzero(np.abs(model.tree.origin[child]) > _NO_LENGTH_M) > 1
    return f"l{parent + 1}{f',{child + 1}' if others else ''}{'xyz'[axis] if several else ''}"


def _com_name(model: RobotModel, link: int, axis: int) -> str:
    return f"lg{link + 1}{'xyz'[axis] if model.axes_of_com[link].sum() > 1 else ''}"


def _mass_words(masses: tuple[int, ...]) -> list[str]:
    """Number the masses from 1; of more than four in a row, the first and the last."""
    runs = [[str(link + 1) for _, link in run] for _, run in groupby(enumerate(masses), lambda pair: pair[1] - pair[0])]
    return [word for run in runs for word in ([run[0], "...", run[-1]] if len(run) > 4 else run)]
