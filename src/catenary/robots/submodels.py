"""A robot in other coordinates: joints locked, an arm cut out of a larger robot, joints on one motor, a held base."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.robots.actuation import Actuation, Effect, Friction, KnownTorque, Spring, actuation_terms
from catenary.robots.assembly import Coordinate, Folded, JointKind, Link, fold, tree_of
from catenary.robots.friction_terms import FRICTION_TERMS
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import BASE, Frame, RobotModel, Tree
from catenary.robots.plausibility import check_different
from catenary.spatial import Pose, identity_pose, rotation_from_vector

_ROOT = ""  # no link's name
# six more coordinates that hold the base: their torques are the force and moment under it
BASE_JOINTS = (*(f"base_force:{axis}" for axis in "xyz"), *(f"base_moment:{axis}" for axis in "xyz"))
_BASE_BODY = "base_body"  # what the base itself weighs, above the sensor
_LIMITS = {"lower": 0.0, "upper": 0.0, "velocity_limit": np.inf, "effort_limit": np.inf}


def lock_joints(model: RobotModel, locked: Mapping[str, float]) -> RobotModel:
    """Return the robot with some coordinates held at values; links that no longer move are merged with their parents.

    Its other coordinates, frames, masses and what loads its joints stay: torques are those of the whole robot at these
    values and rates of zero. Effects on locked coordinates alone are left out, friction and rotors on others too lose
    their locked part.

    Args:
        model: The robot.
        locked: Value of each coordinate that is held [rad or m].

    Raises:
        InputError: An unknown coordinate, all of them, a value outside the limits or not finite, or as
            `driven_actuation`.

    Examples:
        >>> arm = catenary.lock_joints(catenary.load_robot("puma560"), {"joint5": 0.0, "joint6": 0.0})
        >>> arm.joint_names
        ('joint1', 'joint2', 'joint3', 'joint4')
    """
    where = f'robot "{model.name}": lock'
    for name, value in locked.items():
        if name not in model.joint_names:
            raise InputError(f'{where}: no joint "{name}"; joints: {", ".join(model.joint_names)}')
        k = model.joint_names.index(name)
        if not model.lower[k] <= float(as_array(f"{where}: {name}", value, ())) <= model.upper[k]:
            raise InputError(
                f'{where}: joint "{name}": {value:g} {model.joint_units[k]} outside '
                f"[{model.lower[k]:g}, {model.upper[k]:g}]"
            )
    free = [k for k, name in enumerate(model.joint_names) if name not in locked]
    held = np.array([locked.get(name, 0.0) for name in model.joint_names])
    notes = [f"locked: {', '.join(f'{n} at {v:g}' for n, v in locked.items())}"] if locked else []
    return driven_by(where, model, own_coordinates(model, free), np.eye(model.n)[:, free], held, notes)


def own_coordinates(model: RobotModel, places: Sequence[int]) -> list[Coordinate]:
    """Return some of a robot's coordinates with their limits."""
    columns = model.joint_names, model.joint_units, model.lower, model.upper, model.velocity_limit, model.effort_limit
    rows = list(zip(*(np.asarray(column).tolist() for column in columns), strict=True))
    return [Coordinate(*rows[k]) for k in places]


def couple_joints(
    model: RobotModel, coordinates: Sequence[Coordinate], moves: Sequence[Mapping[str, float]]
) -> RobotModel:
    """Return the robot with joints that move together: coordinate k moves each joint of moves[k] by so much per unit.

    The new coordinates stand where the first of their joints stood; joints that none moves stay coordinates.

    Raises:
        InputError: A joint that is none of the robot's coordinates, or a name that another keeps.
    """
    where = f'robot "{model.name}": coordinate'
    driven = np.zeros((model.n, len(coordinates)))
    for k, (c, moved) in enumerate(zip(coordinates, moves, strict=True)):
        for name, factor in moved.items():
            if name not in model.joint_names:
                raise InputError(f'{where} "{c.name}": moves no joint "{name}"; joints: {", ".join(model.joint_names)}')
            driven[model.joint_names.index(name), k] = float(as_array(f'{where} "{c.name}": {name}', factor, ()))
    own = [k for k in range(model.n) if not driven[k].any()]
    columns = np.hstack([driven, np.eye(model.n)[:, own]])
    every, first = [*coordinates, *own_coordinates(model, own)], np.argmax(columns != 0.0, axis=0)
    order = sorted(range(len(every)), key=lambda k: int(first[k]))
    named = [every[k] for k in order]
    check_different(where, [c.name for c in named])
    notes = [f"moves together by {c.name}: {', '.join(m)}" for c, m in zip(coordinates, moves, strict=True)]
    return driven_by(where, model, named, columns[:, order], np.zeros(model.n), notes)


def driven_by(
    where: str,
    model: RobotModel,
    coordinates: Sequence[Coordinate],
    driven: Floats,
    held: Floats,
    notes: Sequence[str] = (),
) -> RobotModel:
    """Return the robot in other coordinates, of which its own are driven @ q + held; links that stand are folded in.

    Torques are the robot's own by the transpose, and so is what loads its joints.

    Args:
        where: Opens errors.
        coordinates: The m new ones, of which each moves a joint.
        driven: (n, m).
        held: (n,) [rad or m].
        notes: What the model's notes say of it.
    """
    coordinates = [_within_joints(c, model, driven[:, k], driven, held) for k, c in enumerate(coordinates)]
    coupling, offset = model.coupling @ driven, model.offset + model.coupling @ held
    moving = [i for i in range(len(offset)) if coupling[i].any()]
    if not moving:
        raise InputError(f"{where}: no joint is left that moves; expected at least one")
    folded = _folded(model, moving, offset)
    carriers, tree = [folded.carrier[name] for name in model.link_names], tree_of(folded)
    links, names = tuple(model.link_names[i] for i in moving), tuple(c.name for c in coordinates)

    def whose(links_before: tuple[str, ...]) -> tuple[str, ...]:
        kept = {carriers[model.link_names.index(link)].link for link in links_before}
        return tuple(name for k, name in enumerate(links) if k in kept)

    frames = {
        name: frame if frame.link < 0 else Frame((on := carriers[frame.link]).link, on.pose @ frame.pose)
        for name, frame in model.frames.items()
    }
    return replace(
        model,
        joint_names=names,
        joint_units=tuple(c.unit for c in coordinates),
        link_names=links,
        tree=tree,
        coupling=coupling[moving],
        offset=offset[moving],
        lower=np.array([c.lower for c in coordinates]),
        upper=np.array([c.upper for c in coordinates]),
        velocity_limit=np.array([c.velocity for c in coordinates]),
        effort_limit=np.array([c.effort for c in coordinates]),
        frames=frames,
        missing_inertia=whose(model.missing_inertia),
        missing_tensor=whose(model.missing_tensor),
        massless=tuple(
            name for name, mass in zip(links, tree.mass, strict=True) if mass == 0.0 and name in model.massless
        ),
        axes_of_com=np.array(folded.axes_of_com),
        closed_form=None,
        actuation=None if model.actuation is None else driven_actuation(where, model.actuation, driven, held),
        unseen=(),
        without_payload=None,
        file_order=tuple(name for name in model.file_order if name in names),
        loops=None,
        notes=(*model.notes, *notes),
    )


def _within_joints(c: Coordinate, model: RobotModel, moves: Floats, driven: Floats, held: Floats) -> Coordinate:
    """Return a coordinate within the limits of the joints that it alone moves, by `moves` (n,) times itself."""
    for i in np.flatnonzero((moves != 0.0) & (np.count_nonzero(driven, axis=1) == 1)):
        lower, upper = sorted(float(end - held[i]) / float(moves[i]) for end in (model.lower[i], model.upper[i]))
        velocity = float(model.velocity_limit[i]) / abs(float(moves[i]))
        c = replace(c, lower=max(c.lower, lower), upper=min(c.upper, upper), velocity=min(c.velocity, velocity))
    return c


def cut_arm(model: RobotModel, base: str, tip: str, *, locked: Mapping[str, float] | None = None) -> RobotModel:
    """Return the arm between two frames of a larger robot, on its own base: the first frame, at rest.

    What hangs on the arm stays as a load, the rest of the robot is removed. Gravity is then given in the axes of
    `base`.

    Args:
        model: The larger robot.
        base: Frame that becomes the arm's base.
        tip: Frame that becomes its tip.
        locked: Values of coordinates that move nothing between the two [rad or m]; the others at zero, or at the limit
            nearest to it.

    Raises:
        InputError: An unknown frame, a tip that the base does not carry, or as `lock_joints`.

    Examples:
        >>> robot = catenary.load_robot("dual_arm_19")
        >>> arm = catenary.cut_arm(robot, robot.base, robot.tip)
        >>> robot.n, arm.n
        (19, 11)
    """
    start, end = model.frame(base), model.frame(tip)
    path, link = list[int](), end.link
    while link not in (start.link, -1):
        path.append(link)
        link = int(model.tree.parent[link])
    if link != start.link or not path:
        raise InputError(f'robot "{model.name}": frame "{tip}" is not moved by joints on "{base}": no arm is between')
    kept = np.atleast_1d(model.coupling[path].any(axis=0))
    nearest = np.clip(0.0, model.lower, model.upper)
    fixed = {name: float(nearest[k]) for k, name in enumerate(model.joint_names) if not kept[k]}
    arm = lock_joints(model, fixed | dict(locked or {}))
    link, stands = arm.frame(base)
    if link >= 0:
        raise InputError(
            f'robot "{model.name}": frame "{base}" is moved by joints of its own arm: {", ".join(arm.joint_names)}'
        )
    back = stands.inverse()
    rotation, origin = arm.tree.rotation.copy(), arm.tree.origin.copy()
    for i in np.flatnonzero(arm.tree.parent < 0):
        rotation[i], origin[i] = back @ Pose(rotation[i], origin[i])
    moved = {name: frame._replace(pose=back @ frame.pose) for name, frame in arm.frames.items() if frame.link < 0}
    moved[base] = Frame(-1, identity_pose())
    if base != BASE and (BASE not in model.frames or model.base == BASE):
        moved[BASE] = Frame(-1, identity_pose())
    tree = arm.tree._replace(rotation=rotation, origin=origin)
    return replace(
        arm, tree=tree, frames={**arm.frames, **moved}, tip=tip, notes=(*arm.notes, f"cut out: {base} to {tip}")
    )


def _folded(model: RobotModel, moving: list[int], offset: Floats) -> Folded:
    """Return the links that move still, with those that are held folded in."""
    tree, links = model.tree, list[Link]()
    for i, name in enumerate(model.link_names):
        pose, kind = Pose(tree.rotation[i], tree.origin[i]), "prismatic" if tree.prismatic[i] else "revolute"
        if i not in moving:
            along = tree.axis[i] * offset[i]
            slid = kind == "prismatic"
            pose = pose @ (Pose(np.eye(3), along) if slid else Pose(rotation_from_vector(along), np.zeros(3)))
            kind = "fixed"
        parent = _ROOT if tree.parent[i] < 0 else model.link_names[tree.parent[i]]
        body = LinkInertia(float(tree.mass[i]), tree.com[i], tree.inertia[i]) if tree.mass[i] > 0.0 else None
        x, y, z = model.axes_of_com[i].tolist()
        links.append(Link(name, parent, cast(JointKind, kind), pose, tree.axis[i], inertia=body, axes_of_com=(x, y, z)))
    return fold(links, _ROOT)


def driven_actuation(where: str, actuation: Actuation, driven: Floats, held: Floats) -> Actuation:
    """Return a robot's actuation along other coordinates, which drive its own.

    Lever springs and known torques continue from the held position; linear springs refuse to.

    Args:
        where: The robot, which opens every message.
        actuation: Actuation along the robot's own coordinates.
        driven: Own coordinates per new one (n, m).
        held: Own coordinates where the new ones are zero (n,) [rad or m].

    Raises:
        InputError: A linear spring on a coordinate that is held or shared.
    """
    kept: dict[str, tuple[Effect, ...]] = {}
    for kind in ("friction", "motor_inertia", "springs", "known_torques"):
        effects = list[Effect]()
        for effect in getattr(actuation, kind):
            shift, change = float(effect.combination @ held), dict[str, Any](combination=effect.combination @ driven)
            if isinstance(effect, KnownTorque):
                shifted = np.poly1d(effect.polynomial)(np.poly1d([1.0, shift]))
                change |= {"along": effect.along @ driven, "polynomial": np.atleast_1d(shifted.coeffs)}
            if not change.get("along", change["combination"]).any():
                continue
            if isinstance(effect, Spring) and effect.lever is not None:
                angle = effect.lever.angle_deg + float(np.rad2deg(shift))
                change["lever"] = replace(effect.lever, angle_deg=angle)
            elif isinstance(effect, Spring) and shift != 0.0:
                raise InputError(f'{where}: spring "{effect.name}" acts on free joints as well')
            effects.append(replace(effect, **change))
        kept[kind] = tuple(effects)
    known = None
    if actuation.values is not None:
        known = {(t.kind, t.name): v for t, v in zip(actuation_terms(actuation), actuation.values, strict=True)}
    for kind in ("friction", "motor_inertia", "springs"):
        kept[kind] = _united(kept[kind], known, actuation.coulomb_velocity)
    changed, scale = replace(actuation, **kept, values=None), actuation.effort_scale  # type: ignore[arg-type]
    values = None if known is None else np.array([known[term.kind, term.name] for term in actuation_terms(changed)])
    # raw efforts of a coordinate that is one of the robot's own; of a new one none are known
    own = [np.flatnonzero((driven == np.eye(driven.shape[1])[k]).all(axis=1)) for k in range(driven.shape[1])]
    known_scale = scale is not None and all(len(places) for places in own)
    return replace(
        changed,
        values=values,
        effort_scale=np.array([scale[p[0]] for p in own]) if known_scale else None,  # type: ignore[index]
    )


def _united(
    effects: Sequence[Effect], known: dict[tuple[str, str], float] | None, coulomb_velocity: float
) -> tuple[Effect, ...]:
    """Return effects of a kind with one for all that act along the same line: no recording tells these apart.

    Numbers are summed there, by kind and name in `known`. Friction that is no such sum stays by itself.
    """
    kept = list[Effect]()
    for effect in effects:
        for other in kept:
            ratio = float(effect.combination @ other.combination / (other.combination @ other.combination))
            if not np.allclose(effect.combination, ratio * other.combination, rtol=0.0, atol=1e-12):
                continue
            if (factors := _summed_by(effect, other, ratio, coulomb_velocity)) is not None:
                for kind, factor in factors.items() if known else ():
                    assert known is not None  # for the type checker
                    known[kind, other.name] += factor * known[kind, effect.name]
                break
        else:
            kept.append(effect)
    return tuple(kept)


def _summed_by(effect: Effect, other: Effect, ratio: float, coulomb_velocity: float) -> dict[str, float] | None:
    """Return by which factors numbers along `ratio` times another's line add to its own; None if they do not."""
    if not isinstance(effect, Friction):
        sprung = [getattr(term, "lever", None) for term in (effect, other)]
        return None if any(sprung) else {"spring" if isinstance(effect, Spring) else "motor_inertia": ratio**2}
    terms = [FRICTION_TERMS[kind] for kind in effect.parts]
    alike = (effect.parts, effect.recording) == (getattr(other, "parts", {}), getattr(other, "recording", ""))
    if not alike or coulomb_velocity > 0.0 or any(term.needs_course for term in terms):
        return None
    return {term.kind: ratio * float(term.load(ratio, 0.0, 0.0, np) / term.load(1.0, 0.0, 0.0, np)) for term in terms}


def on_base_joints(model: RobotModel) -> RobotModel:
    """Return a robot whose first six coordinates, held at zero, carry its base.

    Their torques are the force [N] and the moment about the base's origin [Nm], in base axes, that hold the base: what
    a sensor under it measures. As a regressor these rows are those of a free-flyer [Pinocchio]. The base has a body of
    its own, without numbers; a constant on each of the six is the sensor's bias.
    """
    n, m, tree = model.n, 6, model.tree
    sliding, still = np.arange(m) < 3, np.zeros((m, 3))
    before = Tree(
        parent=np.arange(m) - 1, prismatic=sliding, rotation=np.tile(np.eye(3), (m, 1, 1)), origin=still,
        axis=np.tile(np.eye(3), (2, 1)), mass=np.zeros(m), com=still, inertia=np.zeros((m, 3, 3)),
    )  # fmt: skip
    after = tree._replace(parent=tree.parent + m)  # -1, the base, is the last of the six
    links = (*(f"{name} held" for name in BASE_JOINTS[:-1]), _BASE_BODY)
    own = driven_actuation(model.name, model.assumed_actuation, np.eye(n, m + n, m), np.zeros(n))
    biases = tuple(
        Friction(name, row, coulomb=False, viscous=False)
        for name, row in zip(BASE_JOINTS, np.eye(m, m + n), strict=True)
    )
    limits = {key: np.r_[np.full(m, value), getattr(model, key)] for key, value in _LIMITS.items()}
    return replace(
        model,
        joint_names=(*BASE_JOINTS, *model.joint_names),
        joint_units=(*("m",) * 3, *("rad",) * 3, *model.joint_units),
        link_names=(*links, *model.link_names),
        tree=Tree(*(np.concatenate(pair) for pair in zip(before, after, strict=True))),
        coupling=np.block([[np.eye(m), np.zeros((m, n))], [np.zeros((len(tree.parent), m)), model.coupling]]),
        offset=np.r_[np.zeros(m), model.offset],
        **limits,
        frames={name: Frame(link + m if link >= 0 else link, pose) for name, (link, pose) in model.frames.items()},
        missing_inertia=(_BASE_BODY, *model.missing_inertia),
        massless=(*links[:-1], *model.massless),
        axes_of_com=np.vstack([np.ones((m, 3), dtype=bool), model.axes_of_com]),
        actuation=replace(own, friction=(*biases, *own.friction), values=None, effort_scale=None),
        closed_form=None,
        unseen=(),
        without_payload=None,
        file_order=(),
    )
