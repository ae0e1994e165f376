"""A robot's gravity taken apart as in figure 2: full Z and s, what is deleted, what is merged, the compact form."""

from dataclasses import replace

import numpy as np

from catenary import RobotModel, compact_regressor, gravity_regressor, load_robot
from catenary.arrays import Floats
from catenary.gravity import symbolic_regressor as formulas
from catenary.gravity.compact_regressor import (
    _DOWN,
    CompactRegressor,
    expression_text,
    mass_expression,
    moment_expression,
)
from catenary.gravity.gravity_regressor import carried_links, gravity_parameters
from papers.experiment import Result, run

ZERO, NO_EFFECT = 0, -1  # in place of a parameter's number, from 1
WRITTEN = 3  # joints, up to which the full form is written out


def with_bodies(model: RobotModel, rng: np.random.Generator) -> RobotModel:
    """Return a robot of this structure with random masses, and centres of mass on the axes that it declares."""
    n = len(model.link_names)
    massive = np.array([link not in model.massless for link in model.link_names])
    com = rng.normal(scale=0.1, size=(n, 3)) * model.axes_of_com
    tree = model.tree._replace(mass=rng.uniform(0.5, 3.0, n) * massive, com=com)
    return replace(model, tree=tree, missing_inertia=())


def groups(regressor: CompactRegressor) -> list[int]:
    """Return, for every entry of the full s, the parameter that it is merged into, ZERO or NO_EFFECT."""
    model = regressor.model
    n = len(model.link_names)
    slides = np.flatnonzero(model.tree.prismatic)
    numbers = [ZERO] * (3 * n * (n + 1) + len(slides))
    for place, text in enumerate(parameter_texts(model)):
        if text != "0":
            numbers[place] = NO_EFFECT  # unless it is one of those below
    for number, places in enumerate(regressor.sources, 1):
        for place in places:
            numbers[place] = number
    return numbers


def parameter_texts(model: RobotModel) -> list[str]:
    """Return the full s as formulas: what joint k carries along the axes of frame j, base first."""
    n = len(model.link_names)
    texts = []
    for k in range(n):
        beyond = carried_links(model.tree, k)
        for j in range(-1, n):
            texts += [expression_text(moment_expression(model, j, axis)) if j in beyond else "0" for axis in range(3)]
    return texts + [expression_text(mass_expression(model, int(j))) for j in np.flatnonzero(model.tree.prismatic)]


def block_texts(model: RobotModel, joint: int) -> list[str]:
    """Return the row of a joint in its own block column of the full Z, in units of g_c on a level base."""
    texts = []
    row = int(np.flatnonzero(model.coupling[joint])[0])
    for frame in range(-1, len(model.link_names)):
        for along in range(3):
            terms = full_entry(model, joint, frame, np.eye(3)[along], _DOWN, row)
            short = terms is not None and len(terms) <= formulas.SHORT_TERMS
            name = f"Z{joint + 1},{3 * (frame + 1) + along + 1}"
            texts.append(formulas.terms_text(terms or {}) if short else name)
    return texts


def full_entry(
    model: RobotModel, joint: int, frame: int, axis: Floats, gravity: Floats, coordinate: int
) -> formulas.Written:
    """Write an entry of the paper's full regressor, -gravity . (z_joint x e); None for what is too long.

    Unlike those of `WrittenTerms` it stands for one joint alone, whether it carries the frame or not. joint and frame
    are indices of the tree, frame -1 the base; axis is e (3,) in that frame, gravity (3,) a constant, such as
    (0, 0, -1) for a level base, in units of the free fall; coordinate is the row of the regressor.
    """
    weight = float(model.coupling[joint, coordinate])
    if weight == 0.0 or model.tree.prismatic[joint]:
        return {}
    z, e = _in_base(model, joint, model.tree.axis[joint]), _in_base(model, frame, axis)
    # -gravity . (z x e) = (gravity x e) . z
    return formulas.scaled(_dotted(formulas.crossed(gravity, e), z), weight)


def _in_base(model: RobotModel, link: int, axis: Floats) -> formulas.SymbolicVector:
    """Return an axis of a link in the base frame: along each axis there, as that is seen from the link."""
    x, y, z = (formulas.weighted(axis, formulas.WrittenTerms(model, of_base).seen_from(link)) for of_base in np.eye(3))
    return x, y, z


def _dotted(a: formulas.SymbolicVector, b: formulas.SymbolicVector) -> formulas.Written:
    """Return a . b, multiplied out."""
    total: formulas.Terms = {}
    for one, other in zip(a, b, strict=True):
        if one is None or other is None:
            return None
        for left, x in one.items():
            for right, y in other.items():
                product = tuple(sorted(left + right))
                total[product] = total.get(product, 0.0) + x * y
    terms = formulas.cleaned(total)
    return terms if len(terms) <= formulas.MAX_TERMS else None


@run(revision=1)
def decomposition(robot: str) -> Result:
    """Take a robot's gravity apart; what the forms give is compared at random configurations."""
    model = load_robot(robot)
    regressor = compact_regressor(model)
    rng = np.random.default_rng(0)
    bodies = with_bodies(model, rng)
    q, gravity = rng.normal(size=(20, model.n)), rng.normal(size=(20, 3))
    full, s = gravity_regressor(model, q, gravity), gravity_parameters(bodies).values
    compact = regressor.Z(q, gravity)
    difference = np.abs(full @ s - compact @ regressor.parameters(bodies)).max()
    on_level, compact_on_level = gravity_regressor(model, q, _DOWN), regressor.Z(q, _DOWN)
    n = len(model.link_names)
    own = groups(regressor)
    written = n <= WRITTEN
    return {
        "joints": n,
        "coordinates": model.n,
        "prismatic": int(model.tree.prismatic.sum()),
        "shape": [model.n, full.shape[2]],
        "groups": own,
        "rows": [np.flatnonzero(model.coupling[k]).tolist() for k in range(n)],
        "columns_used": (np.abs(on_level).max(axis=(0, 1)) > 1e-12).tolist(),
        "compact_rows": (np.abs(compact_on_level).max(axis=0) > 1e-12).tolist(),
        "without_effect": list(regressor.ineffective),
        "parameters": list(regressor.labels),
        "entries": regressor.entries(),
        "blocks": [block_texts(model, k) for k in range(n)] if written else [],
        "s": parameter_texts(model) if written else [],
        "largest_difference_Nm": float(difference),
    }
