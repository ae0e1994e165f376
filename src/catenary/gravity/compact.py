"""The compact gravity regressor: the paper's, without parameters that are zero and with equal ones merged.

The paper's s repeats, for every joint, what is carried along every frame's axes. Merged over the joints there remain
at most three first moments per link and one mass per prismatic joint. Which are zero or equal is decided by the
model's symbols (symbols.py), not by its numbers; a parameter without effect on any joint is left out too.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_batch, frozen
from catenary.dynamics.coordinates import place_tree
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.dynamics.kernels import MANY, known_kernel
from catenary.errors import InputError
from catenary.gravity.compact_line import compact_line
from catenary.gravity.entries import SHORT, Terms, mass_entries, moment_entries, terms_text
from catenary.gravity.regressor import carried_links, gravity_parameters, require_parameters
from catenary.gravity.regressor_recursion import (
    CARRIED_MASS,
    Columns,
    Indices,
    Spread,
    compact_recursion,
    spread_of,
    turn_links,
)
from catenary.gravity.symbols import (
    Expression,
    Symbol,
    expression_latex,
    expression_text,
    mass_expression,
    moment_expression,
    monomials,
    symbols_of,
)
from catenary.kernels.compiled import compiled, inlined
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel, Tree

LEVEL = np.array([0.0, 0.0, -1.0])  # gravity on a level base, in units of g_c
NO_EFFECT = 1e-11  # of the largest entry; random configurations show any other column
WIDE = 100  # characters of a line
GEOMETRY = ("parent", "prismatic", "rotation", "origin", "axis")


@dataclass(frozen=True)
class CompactRegressor:
    """Regressor and parameters of one robot, g = Z(q, gravity) s. str() prints it, for a level base.

    It holds for every robot of the same structure and geometry, whatever its masses and centres of mass.
    """

    model: RobotModel
    expressions: tuple[Expression, ...]  # (p,) of the parameters, in the robot's symbols
    units: tuple[str, ...]  # (p,) "kg m", or "kg" of a prismatic joint's carried mass
    columns: Columns  # what each column is made of
    sources: tuple[tuple[int, ...], ...]  # (p,) entries of the full form that are merged in each parameter
    zeros: tuple[int, ...]  # entries of the full form that are zero
    ineffective: tuple[str, ...]  # parameters left out because no joint feels them

    @property
    def labels(self) -> tuple[str, ...]:
        """Expressions of the parameters, such as l1 (m2+m3) + lg1 m1."""
        return tuple(expression_text(expression) for expression in self.expressions)

    @property
    def symbols(self) -> dict[str, Symbol]:
        """What the symbols in the labels stand for."""
        return symbols_of(self.model, self.expressions)

    def Z(self, q: ArrayLike, gravity: ArrayLike) -> Floats:
        """Regressor (n, p), or (N, n, p) for many configurations.

        Args:
            q: (n,) or (N, n) coordinates [rad or m].
            gravity: (3,) or (N, 3) free-fall acceleration in base axes, down: (0, 0, -9.81) upright [m/s2].

        Raises:
            InputError: An argument has another shape or is not finite.
        """
        rows, single = as_batch("q", q, self.model.n)
        gravities = gravity_rows(gravity, len(rows))
        if len(rows) >= MANY:
            return self._kernel().rows(rows, gravities)
        out = np.empty((len(rows), self.model.n, len(self.expressions)))
        _compact_rows(_packed(self.model, self.columns), rows, gravities, out)
        return out[0] if single else out

    def kernel(self) -> Kernel:
        """Return `kernel(q, gravity)`, Z at one configuration, for loops; see `gravity_kernel`."""
        return self._kernel().ready()

    def line(self) -> Line:
        """Z as a straight line of operations, row by row; inputs q (n,) and gravity (3,)."""
        return self._kernel().line

    def _kernel(self) -> Kernel:
        width = len(self.expressions)
        return known_kernel(
            self.model,
            "compact-regressor",
            lambda model: compact_line(model, self.columns, width),
            (self.model.n, width),
        )

    def compress(self, s: ArrayLike) -> Floats:
        """Parameters (p,) from those of the full form, `gravity_parameters`.

        Raises:
            InputError: Another number of entries, or an s that no robot of this structure has: entries that must be
                equal differ, or one that must be zero is not; the message names them.
        """
        n = len(self.model.tree.parent)
        width = 3 * n * (n + 1) + int(self.model.tree.prismatic.sum())
        full = require_parameters("s", s, [f"entry {k} of {width}" for k in range(width)])
        tolerance = 1e-9 * float(np.abs(full).max(initial=0.0))
        for k in self.zeros:
            if abs(full[k]) > tolerance:
                raise InputError(
                    f"s[{k}] is {full[k]:g}: expected 0, this robot's structure has nothing there"
                )
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
        """Parameters (p,) of a robot of this structure, of the one that the regressor was made of when None.

        Raises:
            MissingInertiaError: Links without inertia.
            InputError: A robot of another structure or geometry.
        """
        robot = self.model if model is None else model
        if robot is not self.model:
            _require_same_structure(self.model, robot)
        return self.compress(gravity_parameters(robot).values)

    def entries(self) -> list[list[str]]:
        """Z on a level base in units of g_c, (n, p) texts; "Zr,c" where one is longer than three terms."""
        return self._entries(latex=False)

    def latex(self) -> str:
        """The regressor on a level base and its parameters, for LaTeX."""
        rows = r" \\ ".join(" & ".join(row) for row in self._entries(latex=True))
        vector = r" \\ ".join(f"s_{{{k + 1}}}" for k in range(len(self.expressions)))
        lines = [
            rf"g = g_c \begin{{bmatrix}} {rows} \end{{bmatrix}} \begin{{bmatrix}} {vector} \end{{bmatrix}}"
        ]
        lines += [f"s_{{{k + 1}}} = {expression_latex(e)}" for k, e in enumerate(self.expressions)]
        return "\n".join(lines)

    def __str__(self) -> str:
        table = self.entries()
        names = " ".join(f"s{k + 1}" for k in range(len(self.expressions)))
        lines = [f"g = g_c [{','.join('[' + ' '.join(row) + ']' for row in table)}] [{names}]^T"]
        if len(lines[0]) > WIDE:
            lines = [f"g = g_c (Z1 s1 + ... + Z{len(self.expressions)} s{len(self.expressions)})"]
            lines += [
                f"Z{k + 1} = [{', '.join(row[k] for row in table)}]^T" for k in range(len(self.expressions))
            ]
        lines += [f"s{k + 1} = {label}" for k, label in enumerate(self.labels)]
        if any("Z" in cell for row in table for cell in row):
            lines.append(
                "Zr,c: an entry of more than three terms, -gravity . (z_r x e), e the axis of column c"
            )
        return "\n".join(lines)

    def _entries(self, *, latex: bool) -> list[list[str]]:
        columns = []
        for c in range(len(self.expressions)):
            # merged masses have one expression but several columns: their sum would be long
            own = np.flatnonzero(self.columns.target == c)
            link, along = int(self.columns.link[own[0]]), int(self.columns.along[own[0]])
            column: list[Terms | None] = [None] * self.model.n
            if len(own) == 1 and along == CARRIED_MASS:
                column = mass_entries(self.model, link, LEVEL)
            elif len(own) == 1:
                column = moment_entries(self.model, link, np.eye(3)[along], LEVEL)
            columns.append(column)
        name = "Z_{{{},{}}}" if latex else "Z{},{}"
        table = []
        for r in range(self.model.n):
            row = []
            for c, column in enumerate(columns):
                terms = column[r]
                short = terms is not None and len(terms) <= SHORT
                row.append(terms_text(terms or {}, latex=latex) if short else name.format(r + 1, c + 1))
            table.append(row)
        return table


def compact_regressor(model: RobotModel) -> CompactRegressor:
    """Compact form of the paper's regressor: structurally zero parameters deleted, structurally equal ones merged.

    [gravity-regressor paper, section II and figure 2] Parameters are compared as expressions in which every link has
    a mass and centre of mass of its own, on the axes that it declares (`axes_of_com`): two arms of the same make stay
    apart, and a centre of mass that happens to be zero stays. Beyond the paper, parameters that load no joint under
    any gravity (a first moment along the first joint's axis) are deleted as well.

    Args:
        model: The robot; it needs no inertia.
    """
    tree = model.tree
    n = len(tree.parent)
    prismatic = [int(k) for k in np.flatnonzero(tree.prismatic)]
    wanted = [(j, a) for j in range(n) for a in range(3)] + [(j, CARRIED_MASS) for j in prismatic]
    effects = _effects(model, wanted)
    merged: dict[frozenset[tuple[str, int]], int] = {}
    expressions: list[Expression] = []
    units: list[str] = []
    sources: list[list[int]] = []
    zeros: list[int] = []
    ineffective: list[str] = []
    rows: list[tuple[int, int, int]] = []
    for (link, along), effect in zip(wanted, effects, strict=True):
        if along == CARRIED_MASS:
            expression = mass_expression(model, link)
            places = [3 * n * (n + 1) + prismatic.index(link)]
        else:
            expression = moment_expression(model, link, along)
            carriers = [k for k in range(n) if link in carried_links(tree, k)]
            places = [3 * (n + 1) * k + 3 * (link + 1) + along for k in carriers]
        if not expression:
            zeros += places
            continue
        if not effect:
            ineffective.append(expression_text(expression))
            continue
        key = monomials(expression)
        if key not in merged:
            merged[key] = len(expressions)
            expressions.append(expression)
            units.append("kg" if along == CARRIED_MASS else "kg m")
            sources.append([])
        sources[merged[key]] += places
        rows.append((link, along, merged[key]))
    columns = np.array(rows, dtype=np.int64).reshape(-1, 3)
    return CompactRegressor(
        model=model,
        expressions=tuple(expressions),
        units=tuple(units),
        columns=Columns(*(frozen(np.ascontiguousarray(column)) for column in columns.T)),
        sources=tuple(tuple(entries) for entries in sources),
        zeros=tuple(zeros),
        ineffective=tuple(ineffective),
    )


class PackedRobot(NamedTuple):
    """What compiled code needs to write Z; arrays of one shape are one, as handing each over costs 50 ns."""

    ints: Indices  # sizes, parents, kinds of joints, columns, the coupling's entries
    matrices: Floats  # (3, n_tree, 3, 3) R_parent_i at coordinate zero; then work
    vectors: Floats  # (4, n_tree, 3) origins and axes; then work
    numbers: Floats  # (4, n_tree) offsets; then work
    coupling: Floats  # (n_tree, n)
    weight: Floats  # of the coupling's entries


def _effects(model: RobotModel, wanted: Sequence[tuple[int, int]]) -> list[bool]:
    """Say which columns are not zero everywhere: at random configurations and gravities none is by accident."""
    columns = np.array([(link, along, c) for c, (link, along) in enumerate(wanted)], dtype=np.int64)
    robot = _packed(model, Columns(*(np.ascontiguousarray(c) for c in columns.T)))
    rng = np.random.default_rng(0)
    out = np.empty((4, model.n, len(wanted)))
    _compact_rows(robot, rng.normal(size=(4, model.n)), rng.normal(size=(4, 3)), out)
    largest = np.abs(out).max(axis=(0, 1), initial=0.0)  # a robot may have no coordinates
    return list(largest > NO_EFFECT * largest.max(initial=0.0))


def _require_same_structure(made_of: RobotModel, robot: RobotModel) -> None:
    def moves_alike() -> bool:
        pairs = [(getattr(made_of.tree, name), getattr(robot.tree, name)) for name in GEOMETRY]
        pairs += [(made_of.coupling, robot.coupling), (made_of.offset, robot.offset)]
        return all(np.allclose(ours, theirs, atol=1e-9) for ours, theirs in pairs)

    same = made_of.joint_names == robot.joint_names and made_of.link_names == robot.link_names
    if not (same and moves_alike()):
        raise InputError(
            f'robot "{robot.name}": expected the joints, links and geometry of "{made_of.name}", which the compact '
            "regressor was made of"
        )


def _packed(model: RobotModel, columns: Columns) -> PackedRobot:
    """Put a robot into few arrays; `write_compact` takes them apart."""
    tree, spread = model.tree, spread_of(model.coupling)
    n = len(tree.parent)
    sizes = [len(columns.link), len(spread.coordinate)]
    ints = [sizes, tree.parent, tree.prismatic, *columns, spread.start, spread.coordinate]
    matrices, vectors, numbers = np.empty((3, n, 3, 3)), np.empty((4, n, 3)), np.empty((4, n))
    matrices[0], vectors[0], vectors[1], numbers[0] = tree.rotation, tree.origin, tree.axis, model.offset
    return PackedRobot(
        np.concatenate([np.asarray(part, dtype=np.int64) for part in ints]),
        matrices,
        vectors,
        numbers,
        np.array(model.coupling),
        spread.weight,
    )


@inlined
def write_compact(robot: PackedRobot, q: Floats, gravity: Floats, out: Floats) -> None:
    """Write Z (n, p) of a packed robot."""
    ints, matrices, vectors, numbers = robot.ints, robot.matrices, robot.vectors, robot.numbers
    n, m, entries = numbers.shape[1], ints[0], ints[1]
    at = 2
    parent, prismatic = ints[at : at + n], ints[at + n : at + 2 * n]
    at += 2 * n
    columns = Columns(ints[at : at + m], ints[at + m : at + 2 * m], ints[at + 2 * m : at + 3 * m])
    at += 3 * m
    spread = Spread(ints[at : at + n + 1], ints[at + n + 1 : at + n + 1 + entries], robot.weight)
    # masses are no part of Z: the tree's places for them hold what is at hand
    tree = Tree(
        parent,
        prismatic,  # type: ignore[arg-type]
        matrices[0],
        vectors[0],
        vectors[1],
        numbers[0],
        vectors[0],
        matrices[0],
    )
    place_tree(tree, robot.coupling, numbers[0], q, numbers[1:], matrices[1], vectors[2])
    turn_links(tree, matrices[1], matrices[2], vectors[3])
    g = (gravity[0], gravity[1], gravity[2])
    compact_recursion(tree, numbers[1], matrices[2], vectors[3], g, columns, spread, out)


@compiled
def _compact_rows(robot: PackedRobot, q: Floats, gravity: Floats, out: Floats) -> None:
    for k in range(len(q)):
        write_compact(robot, q[k], gravity[k if len(gravity) > 1 else 0], out[k])
