"""Where a tracker stands and where its marker sits, found from the robot's own motion, with the joints' zeros free.

X p = F(q + offsets) z for every pose: X is T_base_tracker, F the robot's forward kinematics, z the marker in its frame
(AX = ZB of robot-world hand-eye calibration). A marker without orientation is a point. Least squares of what both
sides differ by, without outliers, from the best of many directions that the tracker may look from.

No motion tells the zero of an arm's first joint from a turn of the base about its axis, nor that of its last joint from
how the marker sits: such an offset is held at 0, and said to be. [M. Shah, J. Mech. Robotics 5 (2013); what is
identifiable: L. Everett & T.-W. Hsu, J. Mech. Design 110 (1988)]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Flags, Floats, spread
from catenary.dynamics.kinematics import Configuration
from catenary.errors import InputError
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, identity_pose, quaternion_from_rotation, rotation_from_vector
from catenary.units import DISPLAY

MIN_POSES, _MAX_POSES = 12, 3_000  # the most evenly over the recording
_MIN_NOISE = np.array([5e-5, 5e-4])  # [m], [rad] that no tracker is better than over a workspace, nor an arm's geometry
TRACKER_NOISE = np.array([2e-4, 3e-3])  # [m], [rad] of a tracker
_OUTLIER_SIGMAS = 5.0  # standard deviations of an axis at which an outlier begins: one of 70,000 good poses lies there
_MIN_STRETCHES, _MAX_STRETCHES = 6, 30  # stretches of time whose errors are taken as independent
_OPEN_HALF_WIDTH_RAD = 0.05  # at which a direction is undetermined: a usual tracker sees 1.4 mm of a motion then
_SETTLING_MOTION = {"rad": 0.5, "m": 0.05}  # to either side: a motion that may settle it
_DOUBTFUL_SHARE = 0.05  # of the motion, left by a fit: more than joints' own errors
_STRAIGHT_S, _MAX_RETIMINGS = 1e-3, 5  # [s] for which a speed goes on; how often poses are read at another time
_BLIND_EIGENVALUE_SHARE = 1e-9  # of the largest eigenvalue: what no motion of the robot shows
# directions of a tracker, those followed up, and with how many poses
_LOOKS, _FOLLOWED_LOOKS, _COARSE_POSES = 4_000, 6, 300
_MEDIAN_SIGMAS = 1.538  # of the length of three normal numbers of standard deviation 1
_OFFSETS = 12  # the first of them among the parameters


class TrackedPoses(NamedTuple):
    """Poses of a marker, and what the robot reported at their stamps."""

    position: Floats  # (M, 3) in the tracker's frame [m]
    rotation: Floats | None  # (M, 3, 3) R_tracker_marker; None of a single marker
    q: Floats  # (M, n) [rad or m]
    qd: Floats  # (M, n) [rad/s or m/s]

    def part(self, rows: NDArray[np.generic]) -> "TrackedPoses":
        """Return some of them."""
        rotation = None if self.rotation is None else self.rotation[rows]
        return TrackedPoses(self.position[rows], rotation, self.q[rows], self.qd[rows])

    def evenly(self, count: int) -> "TrackedPoses":
        """Return as many at most, evenly over all."""
        return self.part(spread(len(self.q), count))


PosesAt = Callable[[float], TrackedPoses]  # with what the robot reported so many seconds after their stamps


class Estimate(NamedTuple):
    """What is sought."""

    base: Pose  # T_base_tracker
    marker: Pose  # T_frame_marker; in the frame's axes where the marker has no orientation
    offsets: Floats  # (k,) of the chosen joints: where they are is what they report, and this [rad or m]
    late: float = 0.0  # [s] by which the robot has moved on from what it reports at a pose's stamp


@dataclass(frozen=True)
class TrackerRegistration:
    """What was found, and half-widths that hold 95 % of its errors: 0 of what was given or held."""

    found: Estimate
    base_error: Floats  # (2,) [m] at `middle`, [rad]
    marker_error: Floats  # (2,) [m], [rad]
    offset_error: Floats  # (k,)
    late_error: float
    joint_error: Floats  # (k,) of joints that follow from a pose by the transforms, beside undetermined offsets
    is_told: Flags  # (k,) whether motion tells the joint's offset from the transforms
    middle: Floats  # (3,) of the marker's motion, in the base [m]
    left: Floats  # (1 or 2,) root mean square of an axis' distance from the fit [m], [rad]
    reach: float  # of the motion [m]
    poses: int
    outliers: int

    def notes(self, names: Sequence[str], units: Sequence[str]) -> list[str]:
        """Return the result as notes; transforms as a mapping has them."""
        solved, shown = self.found, [DISPLAY[unit] for unit in units]

        def sizes(error: Floats) -> str:
            parts = zip(("mm", "deg"), (1e3, np.rad2deg(1.0)), error, strict=False)
            return " and ".join(f"{scale * size:.2g} {unit}" for unit, scale, size in parts if size > 0.0)

        notes = [
            f"registered by {self.poses} poses, {sizes(self.left)} rms per axis from the fit, {self.outliers} outliers"
        ]
        notes += [
            f"doubt: what is left is {self.left[0] / self.reach:.0%} of the motion, {1e3 * self.reach:.0f} mm: clocks "
            "far apart, joints in another order or unit, a marker on another frame? The errors stated here may not hold"
        ] * bool(self.left[0] > _DOUBTFUL_SHARE * self.reach)
        middle = f" at {np.round(self.middle, 3).tolist()} m"
        for name, pose, error, where in (
            ("T_base_tracker", solved.base, self.base_error, middle),
            ("T_marker_frame", solved.marker.inverse(), self.marker_error, ""),
        ):
            at = np.round(pose.position, 6).tolist()
            turn = np.round(quaternion_from_rotation(pose.rotation), 7).tolist()
            text = f"{name} = {{ position_m = {at}, quaternion_wxyz = {turn} }}  # 95 %: within {sizes(error)}{where}"
            notes += [text] * bool(error.any())
        rows = list(zip(names, shown, solved.offsets, self.offset_error, self.joint_error, self.is_told, strict=True))
        zeros = [f"{n} {s * x:.3g} +- {s * e:.2g} {unit}" for n, (unit, s), x, e, _, known in rows if known and e > 0.0]
        notes += [f"offsets of the joints' zeros: {', '.join(zeros)}"] * bool(zeros)
        notes += [
            f"no motion tells the zero of {', '.join(name for name, *_, known in rows if not known)} from how the "
            "tracker stands and the marker sits: it was taken as reported. Their q_encoder is right but for a constant "
            "of which a fit learns nothing; T_base_tracker (of the first joint) or T_marker_frame (of the last), "
            "measured otherwise, tells it"
        ] * (not self.is_told.all())
        errors = ", ".join(f"{name} {s * e:.2g} {unit}" for name, (unit, s), _, _, e, _ in rows)
        notes.append(f"what the registration may put q_encoder off by, 95 %: {errors}")
        notes += [
            f"the robot's reports fit the poses best as {1e3 * abs(solved.late):.0f} +- {1e3 * self.late_error:.1g} ms "
            f"{'old' if solved.late > 0.0 else 'early'}: a clock's delay, or slack of the joints; the transforms allow "
            "for it, rows were not moved"
        ] * (abs(solved.late) > max(2.0 * self.late_error, 2e-3))
        return notes


def register(
    model: RobotModel,
    tracked: TrackedPoses,
    chosen: Sequence[int],
    *,
    frame: str | None = None,
    base: Pose | None = None,
    marker: Pose | None = None,
    zeros: Literal["free", "held"] = "free",
) -> TrackerRegistration:
    """Find the transforms that are not given, and the chosen joints' offsets unless their zeros are held.

    `chosen` are the joints that were recorded, `frame` is the robot's that the marker is fixed to (its tip when None),
    `base` T_base_tracker and `marker` T_frame_marker. Rows that are not finite are left out.
    """
    numbers = np.hstack([a.reshape(len(tracked.q), -1) for a in tracked if a is not None])
    seen = tracked.part(np.asarray(np.isfinite(numbers).all(axis=1))).evenly(_MAX_POSES)
    if len(seen.q) < MIN_POSES:
        raise InputError(
            f"registration: {len(seen.q)} of {len(tracked.q)} poses are finite, near enough (is their unit right?) and "
            f"beside joints, expected {MIN_POSES} at least"
        )
    middle = np.median(seen.position, axis=0)
    reach = max(float(np.median(np.linalg.norm(seen.position - middle, axis=1))), 0.02)
    speed = float(np.abs(Configuration(model, seen.q).jacobian(frame)[:, :3] @ seen.qd[:, :, None]).max())
    turns = np.full(3, 1.0 / reach)
    joints = [1.0 if model.joint_units[j] == "m" else 1.0 / reach for j in chosen]
    units = np.concatenate([turns, np.ones(3), turns, np.ones(3), joints, [1.0 / max(speed, 1e-6)]])
    free = [base is None] * 6 + [marker is None and seen.rotation is not None] * 3 + [marker is None] * 3
    basis = np.eye(len(units))[:, [*free, *[zeros == "free"] * len(joints), speed > 1e-6]]
    every = _Problem(model, seen, list(chosen), frame, middle, reach, units, basis, TRACKER_NOISE)
    coarse = replace(every, tracked=seen.evenly(_COARSE_POSES), noise=np.array([0.1 * reach, 0.1]))
    starts = [coarse.solved(start, robust=True, steps=20) for start in coarse.starts(base, marker)]
    best = min(starts, key=lambda at: float(np.log(np.median(coarse.lengths(at), axis=0)).sum()))
    held, is_told = every.without_what_no_motion_tells(coarse.solved(best, robust=True))
    best = best._replace(offsets=np.zeros(len(joints)))
    for _ in range(3):
        best = replace(held, noise=held.noise_of(best)).solved(best, robust=True)
    for _ in range(3):
        noise = held.noise_of(best)
        near = np.asarray((held.lengths(best) < _OUTLIER_SIGMAS * noise[: 1 + (seen.rotation is not None)]).all(axis=1))
        kept = replace(held, tracked=seen.part(near), noise=noise)
        best = kept.solved(best, robust=False)
    kept.refuse_what_is_open(best)
    return kept.with_errors(best, is_told, outliers=int((~near).sum()))


def register_in_time(
    model: RobotModel, poses_at: PosesAt, chosen: Sequence[int], **options: Any
) -> TrackerRegistration:
    """Register with the joints at the time that fits the poses best: one speed goes on for some milliseconds only."""
    late = 0.0
    for _ in range(_MAX_RETIMINGS):
        made = register(model, poses_at(late), chosen, **options)
        late += made.found.late
        if abs(made.found.late) < max(_STRAIGHT_S, 2.0 * made.late_error):
            break
    return replace(made, found=made.found._replace(late=late))


@dataclass(frozen=True)
class _Problem:
    """Least squares of tracked poses over the transforms, the offsets of the chosen joints and a delay.

    Parameters: X turned about the middle of the motion and moved (6), the marker in the frame turned and moved (6),
    offsets (k), the delay; of these the directions of `basis` are sought.
    """

    model: RobotModel
    tracked: TrackedPoses
    chosen: list[int]
    frame: str | None
    middle: Floats  # (3,) of the motion, in the tracker's frame [m]
    reach: float  # [m]
    units: Floats  # (p,) of the parameters, which bring all of them to metres at the marker's reach
    basis: Floats  # (p, m)
    noise: Floats  # (2,) standard deviation of an axis [m], [rad]

    def compare(self, at: Estimate) -> tuple[Floats, Floats]:
        """Return residuals (M, 3 or 6) in base axes [m, rad] and their derivatives by all parameters (M, 3 or 6, p)."""
        t = self.tracked
        q = t.q + at.late * t.qd
        q[:, self.chosen] += at.offsets
        placed = Configuration(self.model, q)
        frame = placed.pose(self.frame)
        seen = t.position @ at.base.rotation.T + at.base.position
        residual = seen - frame.rotation @ at.marker.position - frame.position
        if t.rotation is not None:
            from scipy.spatial.transform import Rotation

            apart = at.base.rotation @ t.rotation @ np.swapaxes(frame.rotation @ at.marker.rotation, 1, 2)
            residual = np.hstack([residual, Rotation.from_matrix(apart).as_rotvec()])
        J = np.zeros((len(q), 6, len(self.units)))
        from_middle = seen - (at.base.rotation @ self.middle + at.base.position)
        J[:, :3, :3] = np.swapaxes(np.cross(np.eye(3)[None], from_middle[:, None]), 1, 2)
        J[:, :3, 3:6] = J[:, 3:, :3] = np.eye(3)
        J[:, 3:, 6:9] = J[:, :3, 9:12] = -frame.rotation
        moved = placed.jacobian(self.frame, at.marker.position)
        J[:, :, _OFFSETS:-1] = -moved[:, :, self.chosen]
        J[:, :, -1] = -(moved @ t.qd[:, :, None])[:, :, 0]
        return residual, J[:, : residual.shape[1]] * self.units

    def scaled(self, at: Estimate) -> tuple[Floats, Floats]:
        """Return residuals in standard deviations, and their derivatives by what is sought."""
        residual, J = self.compare(at)
        scale = np.repeat(1.0 / self.noise, 3)[: residual.shape[1]]
        return residual * scale, (J @ self.basis) * scale[:, None]

    def moved(self, at: Estimate, step: Floats) -> Estimate:
        """Return an estimate moved by parameters (m,)."""
        s = self.units * (self.basis @ step)
        turn, middle = rotation_from_vector(s[:3]), at.base.rotation @ self.middle + at.base.position
        base = Pose(turn @ at.base.rotation, turn @ (at.base.position - middle) + middle + s[3:6])
        marker = Pose(rotation_from_vector(s[6:9]) @ at.marker.rotation, at.marker.position + s[9:12])
        return Estimate(base, marker, at.offsets + s[_OFFSETS:-1], at.late + float(s[-1]))

    def lengths(self, at: Estimate) -> Floats:
        """Return the distance of each pose from the fit, (M, 1 or 2) [m], [rad]."""
        residual = self.compare(at)[0]
        return np.asarray(np.linalg.norm(residual.reshape(len(residual), -1, 3), axis=2))

    def noise_of(self, at: Estimate) -> Floats:
        """Return the standard deviation of an axis, (2,) [m], [rad], by the median."""
        usual = np.median(self.lengths(at), axis=0) / _MEDIAN_SIGMAS
        return np.asarray(np.maximum(_MIN_NOISE, np.append(usual, 1.0)[:2]), dtype=np.float64)

    def solved(self, at: Estimate, *, robust: bool, steps: int = 200) -> Estimate:
        """Return the least squares fit, by Levenberg and Marquardt; robust by Cauchy's weights."""
        damping, cost = 1e-3, np.inf
        r, J = self.scaled(at)
        for _ in range(steps):
            square = (r**2).sum(axis=1) / 9.0
            weight = np.sqrt(1.0 / (1.0 + square) if robust else np.ones(len(r)))
            cost = float(np.log1p(square).sum() if robust else square.sum())
            A = (J * weight[:, None, None]).reshape(-1, J.shape[2])
            H, g = A.T @ A, A.T @ (r * weight[:, None]).ravel()
            lift = np.diag(damping * np.diag(H) + 1e-12 * np.trace(H))
            trial = self.moved(at, np.asarray(np.linalg.solve(H + lift, -g)))
            r_there, J_there = self.scaled(trial)
            there = (r_there**2).sum(axis=1) / 9.0
            gain = cost - float(np.log1p(there).sum() if robust else there.sum())
            if gain > 0.0:
                at, r, J, damping = trial, r_there, J_there, damping / 10.0
            if damping > 1e6 or 0.0 <= gain < 1e-9 * cost:
                break
            damping *= 1.0 if gain > 0.0 else 10.0
        return at

    def starts(self, base: Pose | None, marker: Pose | None) -> list[Estimate]:
        """Return a few of 4,000 looks of a tracker that fit best, its place and the marker's following linearly."""
        from scipy.spatial.transform import Rotation

        t, M = self.tracked, len(self.tracked.q)
        frame = Configuration(self.model, t.q).pose(self.frame)
        X, Z = base or identity_pose(), marker or identity_pose()
        known = (frame.position + frame.rotation @ Z.position - X.position).ravel()  # R_X p + [x] - [R z] = this
        columns = [np.broadcast_to(np.eye(3), (M, 3, 3))] * (base is None) + [-frame.rotation] * (marker is None)
        A = np.concatenate(columns, axis=2).reshape(3 * M, -1)
        drawn = Rotation.from_quat(np.random.default_rng(0).normal(size=(_LOOKS, 4))).as_matrix()
        looks = drawn if base is None else X.rotation[None]
        offsets = known[:, None] - np.einsum("kab,ib->iak", looks, t.position, optimize=True).reshape(3 * M, -1)
        places = np.linalg.pinv(A, rcond=1e-6) @ offsets
        estimates: list[Estimate] = []
        for i in np.argsort(((offsets - A @ places) ** 2).sum(axis=0)).tolist():
            look, x, turn = looks[i], places[:, i], Z.rotation
            if all(np.trace(look.T @ other.base.rotation) < 2.4 for other in estimates):  # 0.8 rad apart
                if marker is None and t.rotation is not None:
                    turns = np.swapaxes(frame.rotation, 1, 2) @ look @ t.rotation
                    turn = Rotation.from_matrix(turns).mean().as_matrix()
                at = Pose(look, x[:3] if base is None else X.position)
                z = Pose(turn, x[-3:] if marker is None else Z.position)
                estimates.append(Estimate(at, z, np.zeros(len(self.chosen))))
            if len(estimates) == _FOLLOWED_LOOKS:
                break
        return estimates

    def information(self, at: Estimate, q: Floats | None = None) -> Floats:
        """Return the mean information of a usual tracker's pose about what is sought (m, m); at joints q if given."""
        one = replace(self, noise=TRACKER_NOISE)
        if q is not None:
            moved = q.copy()
            moved[:, self.chosen] += at.offsets
            seen = at.base.inverse() @ Configuration(self.model, moved).pose(self.frame) @ at.marker
            rotation = None if self.tracked.rotation is None else seen.rotation
            one = replace(one, tracked=TrackedPoses(seen.position, rotation, q, np.zeros_like(q)))
        J = one.scaled(at)[1].reshape(-1, self.basis.shape[1])
        return np.asarray(J.T @ J / len(one.tracked.q))

    def at_random(self, joints: Sequence[int], by: Floats, rows: int, rng: np.random.Generator) -> Floats:
        """Return joints as they were recorded, some of which moved up to `by` (k,) within their limits."""
        q = self.tracked.evenly(rows).q.copy()
        for j in joints:
            i = self.chosen[j]
            q[:, i] = np.clip(q[:, i] + rng.uniform(-by[j], by[j], len(q)), self.model.lower[i], self.model.upper[i])
        return q

    def without_what_no_motion_tells(self, at: Estimate) -> tuple["_Problem", Flags]:
        """Hold offsets that no motion of the robot separates from the transforms; return flags of the others, (k,)."""
        from scipy.linalg import qr

        timeless = replace(self, basis=self.basis[:, self.basis[-1] == 0.0])
        every = range(len(self.chosen))
        q = self.at_random(every, 3.0 * self.units[_OFFSETS:-1] * self.reach, 300, np.random.default_rng(0))

        def blind(problem: _Problem) -> Floats:
            sizes, axes = np.linalg.eigh(problem.information(at, q))
            return np.asarray(problem.basis @ axes[:, sizes < _BLIND_EIGENVALUE_SHARE * sizes[-1]])

        in_offsets = blind(timeless)[_OFFSETS:-1]
        _, R, order = qr(in_offsets.T, mode="economic", pivoting=True)
        held = _OFFSETS + order[: int((np.abs(np.diag(R)) > 1e-3).sum())]
        left = replace(timeless, basis=timeless.basis[:, ~timeless.basis[held].any(axis=0)])
        lost = blind(left)  # such as the height of a planar arm
        axes, sizes, _ = np.linalg.svd(left.basis - lost @ (lost.T @ left.basis), full_matrices=False)
        basis = np.hstack([axes[:, sizes > 0.5], self.basis[:, self.basis[-1] != 0.0]])
        return replace(self, basis=basis), np.asarray(np.linalg.norm(in_offsets, axis=1) < 1e-3)

    def refuse_what_is_open(self, at: Estimate) -> None:
        """Refuse poses that leave a direction open which other motions of the robot would tell; name these."""
        open_at = (1.96 / (_OPEN_HALF_WIDTH_RAD * self.reach)) ** 2 / _MAX_STRETCHES
        timeless = replace(self, basis=self.basis[:, self.basis[-1] == 0.0])
        sizes, axes = np.linalg.eigh(timeless.information(at))
        if sizes[0] > open_at:
            return
        names, rng = [self.model.joint_names[j] for j in self.chosen], np.random.default_rng(0)
        by = np.array([_SETTLING_MOTION[self.model.joint_units[j]] for j in self.chosen])
        moves: tuple[int, ...] = tuple(range(len(names)))
        for joints in (joints for size in (1, 2, 3) for joints in combinations(moves, size)):
            if np.linalg.eigvalsh(timeless.information(at, self.at_random(joints, by, 100, rng)))[0] > open_at:
                moves = joints
                break
        ways = product(("T_base_tracker", "the marker"), ("turned about", "moved along"), "xyz")
        parts = [" ".join(way) for way in ways] + [f"the zero of {name}" for name in names]
        worst = parts[int(np.argmax(np.abs(timeless.basis @ axes[:, 0])[:-1]))]
        shown = [DISPLAY[self.model.joint_units[j]] for j in self.chosen]
        spans = np.ptp(self.tracked.q, axis=0)[self.chosen]
        motion = " and ".join(
            f"{names[j]} by {by[j] * scale:.0f} {unit} to either side (it moved {spans[j] * scale:.2g} {unit} in all)"
            for j, (unit, scale) in ((j, shown[j]) for j in moves)
        )
        raise InputError(
            f"registration: the poses leave open {worst}: move {motion} too, or give T_base_tracker and T_marker_frame"
        )

    def with_errors(self, estimate: Estimate, is_told: Flags, outliers: int) -> TrackerRegistration:
        """Return the fit with its errors, from fits that each leave out one stretch of time.

        The jackknife of clusters holds where errors of a moment are alike; a length's error is that of a sum of squares
        of unlike variances, by its first two moments. [C. Hansen, J. Econometrics 141 (2007); F. Satterthwaite, 1946]
        """
        from scipy.stats import f, t

        r, J = self.scaled(estimate)
        blocks = np.array_split(np.arange(len(r)), _independent(r))
        Hs = [J[rows].reshape(-1, J.shape[2]).T @ J[rows].reshape(-1, J.shape[2]) for rows in blocks]
        gs = [np.einsum("iap,ia->p", J[rows], r[rows]) for rows in blocks]
        whole, dof = np.sum(Hs, axis=0), len(blocks) - 1
        steps = np.array([self.basis @ np.linalg.solve(whole - H, g) for H, g in zip(Hs, gs, strict=True)]) * self.units
        C = dof / len(blocks) * steps.T @ steps

        def length(first: int) -> float:
            part = C[first : first + 3, first : first + 3]
            mean, square = float(np.trace(part)), float((part**2).sum())
            return float(np.sqrt(mean * f.ppf(0.95, mean**2 / square, dof))) if mean > 1e-18 else 0.0

        width = t.ppf(0.975, dof) * np.sqrt(np.diag(C))
        by_parameters = replace(self, tracked=self.tracked.evenly(200)).compare(estimate)[1] / self.units
        by_error = np.linalg.pinv(by_parameters[:, :, _OFFSETS:-1], rcond=1e-3) @ by_parameters[:, :, :_OFFSETS]
        variance = np.einsum("mkp,pq,mkq->mk", by_error, C[:_OFFSETS, :_OFFSETS], by_error, optimize=True)
        return TrackerRegistration(
            found=estimate,
            base_error=np.array([length(3), length(0)]),
            marker_error=np.array([length(9), length(6)]),
            offset_error=width[_OFFSETS:-1],
            late_error=float(width[-1]),
            joint_error=t.ppf(0.975, dof) * np.sqrt(np.median(variance, axis=0)),
            is_told=is_told,
            middle=estimate.base.rotation @ self.middle + estimate.base.position,
            reach=self.reach,
            left=self.noise[: r.shape[1] // 3] * np.sqrt(np.mean(r.reshape(len(r), -1, 3) ** 2, axis=(0, 2))),
            poses=len(r),
            outliers=outliers,
        )


def _independent(residual: Floats) -> int:
    """Return the number of stretches with independent errors, _MIN_STRETCHES to _MAX_STRETCHES."""
    r = residual - residual.mean(axis=0)
    longest = len(r) // (2 * _MIN_STRETCHES)
    alike = (float((r[lag:] * r[:-lag]).sum()) < 0.2 * float((r * r).sum()) for lag in range(1, longest + 1))
    lag = next((i for i, is_new in enumerate(alike) if is_new), longest)
    return int(np.clip(len(r) // (4 * lag) if lag else _MAX_STRETCHES, _MIN_STRETCHES, min(_MAX_STRETCHES, len(r))))
