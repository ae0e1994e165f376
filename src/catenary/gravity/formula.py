"""What holds an arm still as formulas of its joints, with its own masses, for LaTeX."""

from numpy.typing import ArrayLike

from catenary.gravity.compact import compact_regressor
from catenary.gravity.terms import Terms, scaled, sum_of, terms_text
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

LEAST = 1e-9  # of the largest number of all formulas: smaller ones are rounding


def gravity_latex(model: RobotModel, gravity: ArrayLike = LEVEL) -> str:
    """Return what holds each joint still, in Nm and N, as a line of LaTeX: g_{1} = 4.2 c_{1} - 0.5 s_{12}.

    c_{12} is cos(q_1 + q_2), joints in rad and m; numbers have six digits. Sums are written out; where an arm's twists
    make them too long, in terms that are defined once on lines before them. Turns that are quarter turns to within
    1e-6 rad are taken for such.

    Args:
        model: The robot.
        gravity: (3,) in base axes, down [m/s2].

    Raises:
        MissingInertiaError: Links without mass, by name.
        InputError: gravity has another shape or is not finite.
    """
    model.require_masses()
    regressor = compact_regressor(model)
    table, shared = regressor.written(gravity)
    rows: list[Terms] = []
    for entries in table:
        total: Terms = {}
        for value, terms in zip(regressor.parameters(), entries, strict=True):
            total = sum_of(total, scaled(terms, float(value)), most=None)
        rows.append(total)
    sizes = [abs(value) for row in rows for value in row.values()]
    least = LEAST * max(sizes, default=0.0)
    lines = [f"{name} = {terms_text(terms, latex=True)}" for name, terms in shared.items()]
    for j, row in enumerate(rows, 1):
        kept = {atoms: value for atoms, value in row.items() if abs(value) > least}
        lines.append(f"g_{{{j}}} = {terms_text(kept, latex=True)}")
    return "\n".join(lines)
