"""The compact gravity regressor: the paper's, without parameters that are zero and with equal ones merged.

The paper's s repeats, for every joint, what is carried along every frame's axes. Merged over the joints there remain
at most three first moments per link and one mass per prismatic joint. Which are zero or equal is decided by the
model's symbols, not by its numbers; a parameter without effect on any joint is left out too.

Links are numbered from 1 in the tree's order. m2 is link 2's mass; lg2 (lg2x, lg2y, lg2z where it may lie on several
axes) its centre of mass in its frame; l2 the step from frame 2 to the next one along the only axis that it has, l2x its
part along x where it has several, l2,5x that to link 5 where several links hang on link 2. Lengths are signed.
Two expressions are the same parameter if they are the same sum of products; no number of the model is looked at, but
that steps of zero length and the masses of links declared massless are zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.dynamics.recursion import Vector, cross, dot, put, row, transpose_times
from catenary.dynamics.robot_kernels import MANY_CONFIGURATIONS, known_kernel
from catenary.dynamics.symbolic import new_terms, placed
from catenary.errors import InputError
from catenary.gravity.gravity_regressor import (
    CARRIED_MASS,
    RegressorColumn,
    carried_links,
    carries,
    gravity_parameters,
    regressor_columns,
    require_parameters,
)
from catenary.gravity.symbolic_regressor import SHORT_TERMS, Terms, Written, WrittenTerms, sum_of, terms_text
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line, Term
from catenary.robots.model import RobotModel
from catenary.robots.quarter_turns import with_quarter_turns
from catenary.spatial import LEVEL
from catenary.tables import OnScreen, Screen, Table

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
    """Return the meaning of each symbol in expressions, in the order of links: masses, lengths, centres of mass."""
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


_DOWN = np.array([0.0, 0.0, -1.0])  # gravity on a level base, in units of g_c
_NO_EFFECT_RATIO = 1e-11  # of the largest entry; random configurations show any other column
_LINE_CHARACTERS = 100  # characters of a line
_GEOMETRY_FIELDS = ("parent", "prismatic", "rotation", "origin", "axis")
_ROUNDING_RATIO = 1e-9  # of the largest number of all formulas: smaller ones are rounding


@dataclass(frozen=True, repr=False)
class CompactRegressor(OnScreen):
    """Regressor and parameters of one robot, g = Z(q, gravity) s. str() prints it, for a level base.

    It holds for every robot of the same structure and geometry, whatever its masses and centres of mass.
    """

    model: RobotModel
    expressions: tuple[Expression, ...]  # (p,) of the parameters, in the robot's symbols
    units: tuple[str, ...]  # (p,) "kg m", or "kg" of a prismatic joint's carried mass
    columns: tuple[RegressorColumn, ...]  # what the columns are made of
    targets: tuple[int, ...]  # the parameter that each of these belongs to: merged masses are added
    sources: tuple[tuple[int, ...], ...]  # (p,) entries of the full form that are merged in each parameter
    zeros: tuple[int, ...]  # entries of the full form that are zero
    ineffective: tuple[str, ...]  # parameters left out because no joint feels them

    @property
    def screen(self) -> Screen:
        """The regressor on a level base, and its parameters."""
        rows = [(f"s{k + 1}", label, unit) for k, (label, unit) in enumerate(zip(self.labels, self.units, strict=True))]
        title = f"of {self.model.name}: {self.model.n} joints, {len(rows)} parameters"
        return Screen(title, [Table(["parameter", "stands for", "unit"], rows, left_aligned=3)], formula=self.latex)

    @property
    def labels(self) -> tuple[str, ...]:
        """Expressions of the parameters, such as l1 (m2+m3) + lg1 m1."""
        return tuple(expression_text(expression) for expression in self.expressions)

    @property
    def symbols(self) -> dict[str, NamedSymbol]:
        """What the symbols in the labels stand for."""
        return symbols_of(self.model, self.expressions)

    def Z(self, q: ArrayLike, gravity: ArrayLike) -> Floats:
        """Return the regressor (n, p), or (N, n, p), at q (n,) or (N, n) and gravity (3,) or (N, 3) in base axes."""
        rows, single = as_batch("q", q, self.model.n)
        gravities = gravity_rows(gravity, len(rows))
        if len(rows) >= MANY_CONFIGURATIONS:
            return self._kernel().rows(rows, gravities)
        out = np.zeros((len(rows), self.model.n, len(self.expressions)))
        parts = regressor_columns(self.model, self.columns, rows, gravities)
        for c, target in enumerate(self.targets):
            out[..., target] += parts[..., c]
        return out[0] if single else out

    def kernel(self) -> Kernel:
        """Return `kernel(q, gravity)`, Z at one configuration, for loops; see `gravity_kernel`."""
        return self._kernel().ready()

    def line(self) -> Line:
        """Return Z as a straight line of operations, row by row; inputs q (n,) and gravity (3,)."""
        return self._kernel().line

    def _kernel(self) -> Kernel:
        width = len(self.expressions)
        return known_kernel(
            self.model,
            "compact-regressor",
            lambda model: _compact_line(model, self.columns, self.targets, width),
            (self.model.n, width),
        )

    def compress(self, s: ArrayLike) -> Floats:
        """Return the parameters (p,) from those of the full form, `gravity_parameters`."""
        n = len(self.model.tree.parent)
        width = 3 * n * (n + 1) + int(self.model.tree.prismatic.sum())
        full = require_parameters("s", s, [f"entry {k} of {width}" for k in range(width)])
        tolerance = 1e-9 * float(np.abs(full).max(initial=0.0))
        for k in self.zeros:
            if abs(full[k]) > tolerance:
                raise InputError(f"s[{k}] is {full[k]:g}: expected 0, this robot's structure has nothing there")
        for label, entries in zip(self.labels, self.sources, strict=True):
            first = entries[0]
            for k in entries[1:]:
                if abs(full[k] - full[first]) > tolerance:
                    raise InputError(
                        f"s[{first}] is {full[first]:g} and s[{k}] {full[k]:g}: expected equal entries, "
                        f"both are {label}"
                    )
        return np.array([full[entries[0]] for entries in self.sources])

    def parameters(self, model: RobotModel | None = None) -> Floats:
        """Return the parameters (p,) of a robot of this structure, of the regressor's own when None."""
        robot = self.model if model is None else with_quarter_turns(model)
        if robot is not self.model:
            _require_same_structure(self.model, robot)
        return self.compress(gravity_parameters(robot).values)

    def entries(self, *, latex: bool = False) -> list[list[str]]:
        """Return Z on a level base in units of g_c, (n, p) texts; "Zr,c" where one is longer than three terms."""
        name = "Z_{{{},{}}}" if latex else "Z{},{}"
        return [
            [
                terms_text(terms, latex=latex)
                if terms is not None and len(terms) <= SHORT_TERMS
                else name.format(r + 1, c + 1)
                for c, terms in enumerate(row)
            ]
            for r, row in enumerate(self._terms(_DOWN))
        ]

    def latex(self) -> str:
        """Return the regressor on a level base and its parameters, for LaTeX.

        Entries that take more than 64 terms are written in terms that they share, gamma and u, which stand before them.
        """
        rows = r" \\ ".join(" & ".join(row) for row in self.entries(latex=True))
        vector = r" \\ ".join(f"s_{{{k + 1}}}" for k in range(len(self.expressions)))
        lines = [rf"g = g_c \begin{{bmatrix}} {rows} \end{{bmatrix}} \begin{{bmatrix}} {vector} \end{{bmatrix}}"]
        table, shared = self.written(_DOWN)
        lines += [f"{name} = {terms_text(terms, latex=True)}" for name, terms in shared.items()]
        lines += [
            f"Z_{{{r},{c}}} = {terms_text(table[r - 1][c - 1], latex=True)}"
            for r, row in enumerate(self._terms(_DOWN), 1)
            for c, terms in enumerate(row, 1)
            if terms is None or len(terms) > SHORT_TERMS
        ]
        lines += [f"s_{{{k + 1}}} = {expression_text(e, latex=True)}" for k, e in enumerate(self.expressions)]
        return "\n".join(lines)

    def written(self, gravity: ArrayLike) -> tuple[list[list[Terms]], dict[str, Terms]]:
        """Return the entries (n, p) under a constant gravity (3,), and by name terms that the longest share."""
        down = as_array("gravity", gravity, (3,))
        shared = WrittenTerms(self.model, down, shared=True)
        table: list[list[Terms]] = []
        for r, entries in enumerate(self._terms(down)):
            table.append([])
            for c, terms in enumerate(entries):
                if terms is None:
                    terms = reduce(sum_of, [shared.entry(r, *self.columns[k]) for k in self._of(c)])
                    assert terms is not None  # names keep it short
                table[-1].append(terms)
        return table, shared.definitions

    def __str__(self) -> str:
        table = self.entries()
        names = " ".join(f"s{k + 1}" for k in range(len(self.expressions)))
        lines = [f"g = g_c [{','.join('[' + ' '.join(row) + ']' for row in table)}] [{names}]^T"]
        if len(lines[0]) > _LINE_CHARACTERS:
            lines = [f"g = g_c (Z1 s1 + ... + Z{len(self.expressions)} s{len(self.expressions)})"]
            lines += [f"Z{k + 1} = [{', '.join(row[k] for row in table)}]^T" for k in range(len(self.expressions))]
        lines += [f"s{k + 1} = {label}" for k, label in enumerate(self.labels)]
        if any("Z" in cell for row in table for cell in row):
            lines.append("Zr,c: an entry of more than three terms, -gravity . (z_r x e), e the axis of column c")
        return "\n".join(lines)

    def _of(self, column: int) -> list[int]:
        return [k for k, target in enumerate(self.targets) if target == column]

    def _terms(self, gravity: Floats) -> list[list[Written]]:
        """Return the entries under a constant gravity as sums of products, (n, p); None for what is too long."""
        whole = WrittenTerms(self.model, gravity)
        # merged masses have one expression but several columns: their sum would be long
        lone = {c: self.columns[own[0]] for c in range(len(self.expressions)) if len(own := self._of(c)) == 1}
        return [
            [whole.entry(r, *lone[c]) if c in lone else None for c in range(len(self.expressions))]
            for r in range(self.model.n)
        ]


def compact_regressor(model: RobotModel) -> CompactRegressor:
    """Return the paper's regressor without structurally zero parameters, structurally equal ones merged.

    [gravity-regressor paper, section II and figure 2] Parameters are compared as expressions in which every link has
    a mass and centre of mass of its own, on the axes that it declares (`axes_of_com`): two arms of the same make stay
    apart, and a centre of mass that happens to be zero stays. Beyond the paper, parameters that load no joint under
    any gravity (a first moment along the first joint's axis) are deleted as well.

    Args:
        model: The robot; needs no inertia. Turns within 1e-6 rad of quarter turns are taken as such.

    Examples:
        >>> regressor = catenary.compact_regressor(catenary.load_robot("two_link"))
        >>> Z, s = regressor.Z([0.3, 0.5], [0.0, 0.0, -9.81]), regressor.parameters()
        >>> (Z @ s).round(3)
        array([15.766,  1.709])
    """
    model = with_quarter_turns(model)
    tree = model.tree
    n = len(tree.parent)
    prismatic = [int(k) for k in np.flatnonzero(tree.prismatic)]
    candidates = [RegressorColumn(j, a) for j in range(n) for a in range(3)]
    candidates += [RegressorColumn(j, CARRIED_MASS) for j in prismatic]
    effects = _effects(model, candidates)
    merged: dict[frozenset[tuple[str, int]], tuple[Expression, str, list[int]]] = {}  # with unit and sources
    zeros: list[int] = []
    ineffective: list[str] = []
    columns: list[RegressorColumn] = []
    targets: list[int] = []
    for (link, along), effect in zip(candidates, effects, strict=True):
        if along == CARRIED_MASS:
            expression, unit = mass_expression(model, link), "kg"
            places = [3 * n * (n + 1) + prismatic.index(link)]
        else:
            expression, unit = moment_expression(model, link, along), "kg m"
            carriers = np.flatnonzero(carries(tree)[:, link]).tolist()
            places = [3 * (n + 1) * k + 3 * (link + 1) + along for k in carriers]
        if not expression:
            zeros += places
        elif not effect:
            ineffective.append(expression_text(expression))
        else:
            key = monomials(expression)
            merged.setdefault(key, (expression, unit, []))[2].extend(places)
            columns.append(RegressorColumn(link, along))
            targets.append(list(merged).index(key))
    expressions, units, sources = zip(*merged.values(), strict=True) if merged else ((), (), ())
    return CompactRegressor(
        model, expressions, units, tuple(columns), tuple(targets), tuple(map(tuple, sources)), tuple(zeros),
        tuple(ineffective),
    )  # fmt: skip


def _compact_line(model: RobotModel, columns: Sequence[RegressorColumn], targets: Sequence[int], width: int) -> Line:
    """Trace the regressor (n, width), row by row; inputs q (n,) and gravity (3,).

    As `regressor_columns` has it, but in the links' frames. A first moment e asks z . (gravity x e) = e . (z x gravity)
    of a joint that carries it: so z x gravity, two numbers and no sum in the joint's own frame, is turned on
    from link to link, and its parts are the entries. In the base frame every entry would be a scalar product.
    """
    p = placed(model)
    n, m = len(model.tree.parent), len(p.tree.parent)
    g = p.trace.inputs("gravity", 3)
    link_gravity = new_terms(m + 1, 3)
    put(link_gravity, m, (g[0], g[1], g[2]))
    for i in range(m):
        put(link_gravity, i, transpose_times(p.rotation, i, row(link_gravity, p.tree.parent[i])))
    Z = np.full((model.n, width), 0.0, dtype=object)

    def add_in_row(joint: int, column: int, effort: Term) -> None:
        for r in np.flatnonzero(model.coupling[joint]):
            Z[r, column] = Z[r, column] + effort * float(model.coupling[joint, r])

    for k in range(n):
        own = 2 * k + 1
        axis = row(p.tree.axis, own)
        if p.tree.prismatic[own]:
            effort = -dot(axis, row(link_gravity, own))
            if (k, CARRIED_MASS) in columns:
                add_in_row(k, targets[columns.index(RegressorColumn(k, CARRIED_MASS))], effort)
            continue
        turning: dict[int, Vector] = {own: cross(axis, row(link_gravity, own))}  # by link, in its frame
        for i in range(own + 1, m):
            if int(p.tree.parent[i]) in turning:
                turning[i] = transpose_times(p.rotation, i, turning[int(p.tree.parent[i])])
        for (link, along), target in zip(columns, targets, strict=True):
            here = turning.get(2 * link + 1)
            if here is None:
                continue
            if along == CARRIED_MASS:
                effort = p.x[2 * link + 1] * dot(row(p.tree.axis, 2 * link + 1), here)
            else:
                effort = dot(row(p.turn[link], along), here)
            add_in_row(k, target, effort)
    return p.trace.line(list(Z.ravel()))


def _effects(model: RobotModel, columns: Sequence[RegressorColumn]) -> list[bool]:
    """Return the columns that are not zero everywhere, at random configurations and gravities."""
    rng = np.random.default_rng(0)
    Z = regressor_columns(model, columns, rng.normal(size=(4, model.n)), rng.normal(size=(4, 3)))
    largest = np.abs(Z).max(axis=(0, 1), initial=0.0)  # a robot may have no coordinates
    return list(largest > _NO_EFFECT_RATIO * largest.max(initial=0.0))


def _require_same_structure(made_of: RobotModel, robot: RobotModel) -> None:
    pairs = [(getattr(made_of.tree, name), getattr(robot.tree, name)) for name in _GEOMETRY_FIELDS]
    pairs += [(made_of.coupling, robot.coupling), (made_of.offset, robot.offset)]
    same = made_of.joint_names == robot.joint_names and made_of.link_names == robot.link_names
    if not (same and all(np.allclose(ours, theirs, atol=1e-9) for ours, theirs in pairs)):
        raise InputError(
            f'robot "{robot.name}": expected the joints, links and geometry of "{made_of.name}", which the compact '
            "regressor was made of"
        )


def gravity_latex(model: RobotModel, gravity: ArrayLike = LEVEL) -> str:
    """Return all joints' gravity torques [Nm|N] as LaTeX: g_{1} = 4.2 c_{1} - 0.5 s_{12}, c_{12} = cos(q_1 + q_2).

    Sums are written out; where an arm's twists make them too long, in terms that are defined once on the lines before.
    Numbers have six digits; turns within 1e-6 rad of quarter turns are taken as such.

    Args:
        model: The robot; needs masses.
        gravity: Free-fall acceleration in base axes (3,) [m/s2].
    """
    model.require_masses()
    regressor = compact_regressor(model)
    table, shared = regressor.written(gravity)
    rows: list[Terms] = []
    for entries in table:
        rows.append({})
        for value, terms in zip(regressor.parameters().tolist(), entries, strict=True):
            for atoms, factor in terms.items():
                rows[-1][atoms] = rows[-1].get(atoms, 0.0) + factor * value
    sizes = [abs(value) for terms in rows for value in terms.values()]
    cutoff = _ROUNDING_RATIO * max(sizes, default=0.0)
    lines = [f"{name} = {terms_text(terms, latex=True)}" for name, terms in shared.items()]
    for j, terms in enumerate(rows, 1):
        kept = {atoms: value for atoms, value in terms.items() if abs(value) > cutoff}
        lines.append(f"g_{{{j}}} = {terms_text(kept, latex=True)}")
    return "\n".join(lines)
