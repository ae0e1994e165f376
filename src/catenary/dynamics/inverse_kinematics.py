"""Joint coordinates that bring a frame to a pose."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_positive
from catenary.dynamics.kinematics import Configuration
from catenary.dynamics.raven_inverse_kinematics import raven_path
from catenary.errors import InputError, UnreachablePoseError
from catenary.plant import Bounded
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, as_pose, rotation_vector

Match = Literal["pose", "position"]
_LEAST_DAMPING = 1e-12
_NEAREST = 1e-9  # [m, rad] at which there is nothing nearer to look for
_MAX_DAMPING = 1e8


class Approach(NamedTuple):
    """Result of a search: coordinates, and distance to the target."""

    q: Floats  # (n,) [rad or m]
    position_error: float  # [m]
    orientation_error: float  # [rad], 0 when only the position counts


def inverse_kinematics(
    model: RobotModel,
    pose: Pose | ArrayLike,
    q_start: ArrayLike | None = None,
    *,
    frame: str | None = None,
    match: Match | None = None,
    position_tolerance: float = 1e-7,
    orientation_tolerance: float = 1e-7,
    rng: np.random.Generator | None = None,
    starts: int = 20,
    max_iterations: int = 300,
) -> Floats:
    """Return coordinates (n,) [rad or m] within the joint limits that bring a frame to a pose in the base frame [m].

    The pose is a `Pose`, as `forward_kinematics` returns it, or a homogeneous matrix (4, 4).

    RAVEN-II arms have a closed form: exact, nearest to `q_start` (raven_inverse_kinematics.py). Other arms are
    searched by damped least squares from `q_start`, then, if an `rng` is given, from random starts.

    Args:
        q_start: (n,) where to search from; the middle of the limits when None.
        frame: The model's tip when None.
        match: "pose", or "position" alone; "pose" when None, but for fewer than 6 coordinates "position".
        position_tolerance: Largest distance that counts as reached [m]; the closed form needs none.
        orientation_tolerance: Largest angle that counts as reached [rad].
        rng: Draws further `starts` within the limits; only the first one is tried when None.
        max_iterations: Steps tried from each start.

    Raises:
        UnreachablePoseError: The remote centre or a joint limit refuses the pose, or the search did not reach
            it; the message says which, or how near it came.

    Examples:
        >>> arm = catenary.load_robot("puma560")
        >>> pose = catenary.forward_kinematics(arm, [0.1, 0.2, -0.3, 0.4, 0.5, 0.6])
        >>> q = catenary.inverse_kinematics(arm, pose, q_start=[0.0, 0.0, 0.0, 0.3, 0.3, 0.3])
        >>> np.allclose(catenary.forward_kinematics(arm, q).position, pose.position)
        True
    """
    target = as_pose("pose", pose)
    start = None if q_start is None else as_array("q_start", q_start, (model.n,))
    record = model.frame(frame)
    own_match: Match = "pose" if model.n >= 6 else "position"
    match = own_match if match is None else match
    if match not in ("pose", "position"):
        raise InputError(f'match: expected "pose" or "position", got {match!r}')
    as_positive("position_tolerance", position_tolerance)
    as_positive("orientation_tolerance", orientation_tolerance)
    tolerances = (position_tolerance, orientation_tolerance)

    tip = model.frame()
    same_point = match == "pose" or np.array_equal(record.pose.position, tip.pose.position)
    if model.closed_form == "raven2" and match == own_match and record.link == tip.link and same_point:
        tip_in_frame = record.pose.inverse() @ tip.pose
        goal = target @ tip_in_frame
        path = raven_path(model, goal.rotation[np.newaxis], goal.position[np.newaxis], start)
        return path.reshape(model.n)

    best: Approach | None = None
    lower, upper = search_range(model)
    tried = [0.5 * (lower + upper) if start is None else start]
    if rng is not None:
        tried += [rng.uniform(lower, upper) for _ in range(starts)]
    for q in tried:
        approach = nearest_coordinates(
            model, target, q, frame=frame, match=match, tolerances=tolerances, max_iterations=max_iterations
        )
        if approach.position_error <= position_tolerance and approach.orientation_error <= orientation_tolerance:
            return approach.q
        # a radian counts as a metre: it only decides which attempt the message tells of
        if best is None or sum(approach[1:]) < sum(best[1:]):
            best = approach
    assert best is not None
    raise UnreachablePoseError(_message(model, model.tip if frame is None else frame, match, best, len(tried)))


def nearest_coordinates(
    model: RobotModel,
    pose: Pose,
    q_start: Floats,
    *,
    frame: str | None = None,
    match: Match = "pose",
    tolerances: tuple[float, float] = (_NEAREST, _NEAREST),
    max_iterations: int = 300,
) -> Approach:
    """Return the coordinates within the limits whose frame comes nearest to a pose: a local search from a start.

    For measured poses, and for arms with fewer than six coordinates, which reach no arbitrary pose exactly. Nearest is
    the least sum of squares of the distance [m] and the angle [rad].

    Levenberg-Marquardt: step = (J^T J + damping 1)^-1 J^T e, e the position error [m] over the rotation that
    is left [rad]; the damping shrinks after a step that helped and grows until one does. A coordinate that a
    step would press against its limit is left out of it. [D. Marquardt, J. SIAM 11 (1963); for inverse
    kinematics T. Sugihara, IEEE Trans. Robotics 27 (2011)]

    Args:
        pose: Target pose in the base frame.
        q_start: Start of the search (n,) [rad or m].
        frame: Frame to place; the tip when None.
        match: "pose", or "position" alone.
        tolerances: Distance [m] and angle [rad] at which the search ends.
        max_iterations: Most steps of the search.
    """
    rows = 6 if match == "pose" else 3

    def error(placed: Configuration) -> Floats:
        there = placed.pose(frame)
        offset = pose.position - there.position
        if match == "position":
            return offset
        return np.concatenate([offset, rotation_vector(pose.rotation @ there.rotation.T)])

    def reached(e: Floats) -> bool:
        return bool(np.linalg.norm(e[:3]) <= tolerances[0] and np.linalg.norm(e[3:]) <= tolerances[1])

    q = np.clip(q_start, model.lower, model.upper)
    placed = Configuration(model, q)
    e, damping = error(placed), 1e-3
    for _ in range(max_iterations):
        if reached(e) or damping > _MAX_DAMPING:
            break
        J = placed.jacobian(frame)[:rows]
        pull = J.T @ e
        free = ~((pull < 0.0) & (q <= model.lower) | (pull > 0.0) & (q >= model.upper))
        step = np.zeros(model.n)
        J_free = J[:, free]
        step[free] = np.linalg.solve(J_free.T @ J_free + damping * np.eye(J_free.shape[1]), pull[free])
        trial = np.clip(q + step, model.lower, model.upper)
        placed_there = Configuration(model, trial)
        e_trial = error(placed_there)
        if e_trial @ e_trial < e @ e:
            q, placed, e = trial, placed_there, e_trial
            damping = max(damping / 10.0, _LEAST_DAMPING)
        else:
            damping *= 5.0
    return Approach(q, float(np.linalg.norm(e[:3])), float(np.linalg.norm(e[3:])))


def search_range(limits: Bounded) -> tuple[Floats, Floats]:
    """Return limits, and where there is none a turn or two metres about zero or beside the limit that there is."""
    half = np.where(np.array(limits.joint_units) == "m", 1.0, np.pi)
    lower, upper = np.array(limits.lower), np.array(limits.upper)
    no_lower, no_upper = np.isinf(lower), np.isinf(upper)
    both = no_lower & no_upper
    lower = np.where(both, -half, np.where(no_lower, upper - 2 * half, lower))
    upper = np.where(both, half, np.where(no_upper, lower + 2 * half, upper))
    return lower, upper


def _message(model: RobotModel, frame: str, match: Match, best: Approach, attempts: int) -> str:
    distance = f"{best.position_error:.3g} m"
    if match == "pose":
        distance += f" and {best.orientation_error:.3g} rad"
    at_limits = [
        f'joint "{name}" at {value:.6g} {unit}'
        for name, value, unit, lower, upper in zip(
            model.joint_names, best.q, model.joint_units, model.lower, model.upper, strict=True
        )
        if value in (lower, upper)
    ]
    limits = f"; at its limit there: {', '.join(at_limits)}" if at_limits else ""
    more = "; pass rng to try further starts" if attempts == 1 else ""
    return (
        f'robot "{model.name}": frame "{frame}" did not reach the {match}: nearest {distance} away '
        f"after {attempts} start(s){limits}{more}"
    )
