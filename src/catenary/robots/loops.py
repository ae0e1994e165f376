"""Closed loops: four-bars, parallelograms, cranks. The joints that no motor drives follow those that one does.

A loop is an open tree and points of two frames that stay together: r_a(q) = r_b(q). With A = d(r_a - r_b)/dq the
passive joints move by A_p qd_p = -A_m qd_m, so qd = J qd_m, and by power the motors' torques are J^T times the tree's
[Featherstone, Rigid Body Dynamics Algorithms, chapter 8]. Where J is constant, as of parallelograms, the robot is a
tree with a coupling and all that the package does holds for it; others are `gravity/closed_robot.py`'s.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.config import Settings
from catenary.errors import ClosedLoopError, ConfigError, InputError, UnsupportedModelError
from catenary.robots.model import Loop, Loops, RobotModel
from catenary.robots.submodels import driven_by, own_coordinates
from catenary.spatial import Pose

_STEP = 0.05  # [rad or m] of a motor, from one place of the passive joints to the next
_FARTHEST = 100.0  # [rad or m] of a motor, from where the loops are assembled
_MAX_CORRECTIONS = 20  # of Newton's in one step
_CORRECTION = 0.2  # [rad or m] by which these may move a passive joint; farther on the loop may close another way
_ASSEMBLY = 0.5  # [rad or m] by which a passive joint may stand off where it is said to be assembled
_CLOSED_M = 1e-12  # [m] by which points of a closed loop may lie apart
_APART_M = 1e-9  # [m] from which a loop does not close
_DEAD_CENTRE_RATIO = 1e-5  # of singular values of A_p, below which a passive joint does not follow
_LINEAR_SPAN = 0.2  # [rad or m] of the motors to either side, in which J is looked at
_LINEAR = 1e-9  # by which entries of a constant J may differ
_DECIMALS = 12  # that are kept of a constant J: smaller parts are rounding
_PROBES = 12


def stated_places(
    model: RobotModel, degrees: Mapping[str, float], metres: Mapping[str, float], key: str
) -> dict[str, float]:
    """Return joints' places [rad or m] from a table's `{key}_deg` and `{key}_m`; refuse those in the other's unit."""
    for name in [*degrees, *metres]:
        unit = model.joint_units[model.joint_names.index(name)] if name in model.joint_names else ""
        if unit and (unit == "rad") != (name in degrees):
            raise InputError(f'"{name}" is in {unit}: expected {key}_{"deg" if unit == "rad" else "m"} for it')
    return {name: float(np.deg2rad(angle)) for name, angle in degrees.items()} | dict(metres)


class LoopTable(Settings):
    """A loop in a robot's table: a point of one frame is a point of another."""

    name: str
    frames: tuple[str, str]
    points_m: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0, 0, 0), (0, 0, 0))


class LoopSettings(Settings):
    """Keys of a table that closes loops."""

    loop: tuple[LoopTable, ...] = ()
    motors: tuple[str, ...] = ()  # coordinates that are driven; the others follow
    assembled_deg: dict[str, float] = Field(default_factory=dict)  # turning joints, next to where the loops close
    assembled_m: dict[str, float] = Field(default_factory=dict)  # sliding ones

    def on(self, model: RobotModel) -> RobotModel:
        """Return a robot with these loops, open still, beside those that it has."""
        if not self.loop and not self.motors:
            if self.assembled_deg or self.assembled_m:
                raise ConfigError("assembled: expected with a loop or motors")
            return model
        before = model.loops or Loops((), (), np.zeros(model.n))
        loops = (*before.loops, *(Loop(loop.name, loop.frames, np.array(loop.points_m)) for loop in self.loop))
        place, known = before.assembled.copy(), dict(zip(model.joint_names, range(model.n), strict=True))
        stated = stated_places(model, self.assembled_deg, self.assembled_m, "assembled")
        for name in (*self.motors, *stated):
            if name not in known:
                raise InputError(f'loop: unknown joint "{name}"; joints: {", ".join(known)}')
        for name, value in stated.items():
            place[known[name]] = value
        if not loops:
            raise ConfigError("motors: the robot has no loop whose other joints would follow")
        for loop in self.loop:
            for frame in loop.frames:
                model.frame(frame)
        return replace(model, loops=Loops(loops, self.motors or before.motors, place))


class LoopChain:
    """The passive joints of a robot with loops as functions of its motors.

    Args:
        model: With loops, whose joints are all coordinates.

    Raises:
        UnsupportedModelError: Loops that do not close where they are assembled, or whose motors, named in the message,
            leave a passive joint free or do not move by themselves.
    """

    def __init__(self, model: RobotModel) -> None:
        assert model.loops is not None
        self.model, self.loops = model, model.loops
        motors = self.loops.motors
        self.motors = [k for k, name in enumerate(model.joint_names) if name in motors]
        self.passive = [k for k, name in enumerate(model.joint_names) if name not in motors]
        where, names = f'robot "{model.name}"', ", ".join(loop.name for loop in self.loops.loops)
        try:
            start = self._closed(self.loops.assembled[None].copy(), _ASSEMBLY)
        except InputError as error:
            raise UnsupportedModelError(f"{error}, within {_ASSEMBLY} rad or m of where it is assembled") from error
        _, A = self.constraint(start)
        free = model.n - int(np.linalg.matrix_rank(A[0], tol=_DEAD_CENTRE_RATIO * np.abs(A).max()))
        if free != len(motors) or not self.is_determined(A).all():
            raise UnsupportedModelError(
                f"{where}: loop {names}: {free} joints move by themselves, expected as many motors that the others "
                f"follow; motors: {', '.join(motors) or 'none stated'}; joints: {', '.join(model.joint_names)}"
            )
        self.start = start[0]

    def constraint(self, q: Floats) -> tuple[Floats, Floats]:
        """Return the gaps of the loops' points at q (N, n), (N, 3 L) [m], and their derivative A (N, 3 L, n)."""
        model, gaps, rows = self.model, list[Floats](), list[Floats]()
        poses = _link_poses(model, q)
        for loop in self.loops.loops:
            gap, A = np.zeros((len(q), 3)), np.zeros((len(q), 3, model.n))
            for sign, name, point in zip((1.0, -1.0), loop.frames, loop.points, strict=True):
                i, own = model.frame(name)
                at = (own if i < 0 else poses[i] @ own) @ Pose(np.eye(3), point)
                gap += sign * at.position
                while i >= 0:
                    axis = poses[i].rotation @ model.tree.axis[i]
                    if not model.tree.prismatic[i]:
                        axis = np.cross(axis, at.position - poses[i].position)
                    A += sign * axis[:, :, None] * model.coupling[i]
                    i = int(model.tree.parent[i])
            gaps.append(gap)
            rows.append(A)
        return np.concatenate(gaps, axis=1), np.concatenate(rows, axis=1)

    def is_determined(self, A: Floats) -> Any:
        """Return flags (N,) of configurations in which the passive joints follow the motors: no dead centres."""
        sizes = np.linalg.svd(A[:, :, self.passive], compute_uv=False)
        if sizes.shape[1] < len(self.passive):
            return np.zeros(len(A), dtype=bool)
        return sizes[:, len(self.passive) - 1] > _DEAD_CENTRE_RATIO * sizes[:, 0]

    def followed(self, A: Floats, rhs: Floats) -> Floats:
        """Return the passive joints' rates (N, k) or (N, k, m) that make A qd_passive = -asked, in least squares."""
        solved = np.linalg.pinv(A[:, :, self.passive], rcond=_DEAD_CENTRE_RATIO) @ rhs
        return np.asarray(-solved)

    def coordinates(self, driven: Floats) -> Floats:
        """Return all joints (N, n) at the motors' places (N, m), reached from where the loops are assembled.

        Raises:
            InputError: A place that the loops do not reach, or reach only through a dead centre.
        """
        q = np.tile(self.start, (len(driven), 1))
        way = driven - q[:, self.motors]
        if not (in_reach := np.abs(way).max(axis=1, initial=0.0) < _FARTHEST).all():
            q[:, self.motors] = driven
            self._refuse(f"is followed {_FARTHEST:g} rad or m far, not to a place", q[int(np.argmin(in_reach))])
        steps = max(1, int(np.ceil(np.abs(way).max(initial=0.0) / _STEP)))
        for k in range(steps):
            _, A = self.constraint(q)
            self._require_determined(A, q)
            q[:, self.passive] += self.followed(A, A[:, :, self.motors] @ (way / steps)[:, :, None])[:, :, 0]
            q[:, self.motors] = driven if k == steps - 1 else q[:, self.motors] + way / steps
            q = self._closed(q, _CORRECTION)
        self._require_determined(self.constraint(q)[1], q)
        return q

    def jacobian(self, q: Floats) -> Floats:
        """Return the Jacobian of all joints by the motors, J (N, n, m) of qd = J qd_motors, at q (N, n)."""
        _, A = self.constraint(q)
        J = np.zeros((len(q), self.model.n, len(self.motors)))
        J[:, self.motors] = np.eye(len(self.motors))
        J[:, self.passive] = self.followed(A, A[:, :, self.motors])
        return J

    def _closed(self, q: Floats, reach: float) -> Floats:
        """Return q (N, n) with the passive joints where the loops close, no farther away than `reach` [rad or m]."""
        before = q.copy()
        for _ in range(_MAX_CORRECTIONS):
            gap, A = self.constraint(q)
            if np.abs(gap).max(initial=0.0) < _CLOSED_M:
                break
            q[:, self.passive] += self.followed(A, gap[:, :, None])[:, :, 0]
        gaps, moved = np.abs(self.constraint(q)[0]).max(axis=1), np.abs(q - before).max(axis=1)
        is_closed = (gaps < _APART_M) & (moved < reach)
        if not is_closed.all():
            self._refuse("does not close", q[int(np.argmin(is_closed))])
        return q

    def _require_determined(self, A: Floats, q: Floats) -> None:
        if not (determined := self.is_determined(A)).all():
            self._refuse("is at a dead centre", q[int(np.argmin(determined))])

    def _refuse(self, what: str, q: Floats) -> None:
        model = self.model
        at = ", ".join(f"{model.joint_names[k]} {q[k]:.4g} {model.joint_units[k]}" for k in self.motors)
        names = ", ".join(loop.name for loop in self.loops.loops)
        raise InputError(f'robot "{model.name}": loop {names} {what} with {at or "no motor"}')


def close_loops(model: RobotModel) -> RobotModel:
    """Return a robot in its motors' coordinates, whose passive joints follow them linearly.

    Raises:
        ClosedLoopError: They follow otherwise.
        UnsupportedModelError: As of `LoopChain`.
    """
    if model.loops is None:
        return model
    chain = LoopChain(model)
    where = f'robot "{model.name}": loop {", ".join(loop.name for loop in model.loops.loops)}'
    rng = np.random.default_rng(0)
    apart = rng.uniform(-_LINEAR_SPAN, _LINEAR_SPAN, (_PROBES, len(chain.motors)))
    at_start = np.round(chain.jacobian(chain.start[None])[0], _DECIMALS)
    try:
        is_linear = np.abs(chain.jacobian(chain.coordinates(chain.start[chain.motors] + apart)) - at_start).max()
    except InputError:
        is_linear = np.inf
    if not is_linear < _LINEAR:
        raise ClosedLoopError(
            f"{where}: a loop cannot be represented by a tree unless its joints follow the motors linearly, as a "
            "parallelogram's do; catenary gravity and catenary.load_closed_robot have its torques"
        )
    held = np.round(chain.start - at_start @ chain.start[chain.motors], _DECIMALS)
    follow = ", ".join(model.joint_names[k] for k in chain.passive)
    notes = [f"joints that follow in a loop: {follow}"]
    return driven_by(where, model, own_coordinates(model, chain.motors), at_start, held, notes)


def _link_poses(model: RobotModel, q: Floats) -> list[Pose]:
    """Return the poses of the links in the base at q (N, n), N of each."""
    from scipy.spatial.transform import Rotation  # a robot without loops loads faster without it

    tree, x, poses = model.tree, q @ model.coupling.T + model.offset, list[Pose]()
    still = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for i, parent in enumerate(tree.parent):
        if tree.prismatic[i]:
            moved = Pose(still[0], x[:, i, None] * tree.axis[i])
        else:
            moved = Pose(Rotation.from_rotvec(x[:, i, None] * tree.axis[i]).as_matrix(), still[1])
        joint = Pose(tree.rotation[i], tree.origin[i]) @ moved
        poses.append(joint if parent < 0 else poses[parent] @ joint)
    return poses
