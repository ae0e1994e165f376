"""Joint positions from a tracked marker: its pose in the base, and inverse kinematics from where the robot was.

The robot's own word of where its tip is, held against its file, shows a wrong robot, tool or base frame at once.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.bounded_parsers import cut
from catenary.dynamics.inverse_kinematics import nearest_coordinates
from catenary.dynamics.kinematics import Configuration
from catenary.errors import InputError
from catenary.recording.import_formats.column_groups import POSE_PARTS, poses_by_parts, poses_of
from catenary.recording.import_formats.columns import Place, Stream, places_of
from catenary.recording.import_formats.mapping import SI, TrackedPose
from catenary.recording.import_formats.registration import (
    MIN_POSES,
    TRACKER_NOISE,
    PosesAt,
    TrackedPoses,
    register_in_time,
)
from catenary.robots.model import Frame, RobotModel
from catenary.spatial import Pose
from catenary.units import DISPLAY

# Standard deviations [rad, m] from which a pose is no truth of a joint: so many times the median, within these.
# Errors that a model learns are some tenths of a degree; a usual tracker leaves a wrist 1 deg at 10 deg from singular
# poses.
_MAX_DEVIATION, _MAX_DEVIATION_MEDIANS = {"rad": np.deg2rad([1.0, 3.0]), "m": np.array([1e-3, 3e-3])}, 4.0
_SINGULAR_REACH = {"rad": 0.1, "m": 0.02}  # by which a joint leads away from a singular pose
_OPEN_SHARE = 1e-4  # of what other motions move a frame by: less than a measured pose tells
_MAX_POSITION_M = 1e3  # [m] of a position: trackers write -3.7e28, or zeros, for a marker that they do not see
_MAX_TURN_LEFT_RAD = 0.02  # [rad] left of orientations, from which they may be written in another way
_UNRELATED_TURN_DEG = 30.0  # [deg] from the robot's
_UNRELATED_WHY = (
    "and in no other way as it does: clocks seconds apart, another frame, or the tracker in the marker's axes?"
)
_AXES = ("xyz", "xyzw")
_TIP_VERBS = ("local/measured_cp", "measured_cp")  # of CRTK; the first is in the arm's own base
_COMPARED_POSES = 300  # poses that are compared, evenly
_SAME_TIP_MM_DEG = np.array([1.0, 0.5])  # [mm], [deg] within which both are the same
_STEADY_SHARE = 0.05  # of a distance, by which what a tool or a base frame is off by may differ from pose to pose
_LATENESS_ROUNDS = 5
_MARKER = "the tracked marker"  # a frame of the robot


def pose_places(tracked: TrackedPose, streams: Sequence[Stream]) -> list[Place]:
    """Return the columns of a pose: x, y, z, and orientation if any."""
    count = len(tracked.columns)
    if count in (3, 6, 7):
        quaternion = tracked.orientation in ("xyzw", "wxyz")
        if count != 3 and quaternion != (count == 7):
            expected = "7 columns of a pose with a quaternion, 6 of one with three angles"
            raise InputError(f'pose: {count} columns with orientation = "{tracked.orientation}": expected {expected}')
        return [place for column in tracked.columns for place in places_of(column, streams)]
    if count != 1:
        raise InputError(f"pose: {count} columns, expected a message's pose, or three, six or seven columns")
    reference = tracked.columns[0]
    parts = [
        [f"{reference}.{part}.{axis}" for part, axes in zip(parts, _AXES, strict=True) for axis in axes]
        for parts in POSE_PARTS
    ]
    parts += [[f"{reference}{inside}.{axis}" for axis in "xyz"] for inside in (".position", ".translation", "")]
    for names in parts:
        try:
            return [place for name in names for place in places_of(name, streams)]
        except InputError:
            continue
    poses = [pose.name for pose in poses_of(streams)]
    raise InputError(f'no pose "{cut(reference)}"; there are {", ".join(map(cut, poses[:10])) or "none"}')


def positions_and_rotations(tracked: TrackedPose, values: Floats) -> tuple[Floats, Floats | None]:
    """Return positions (M, 3) [m] and R_tracker_marker (M, 3, 3) or None; NaN if no pose was seen."""
    from scipy.spatial.transform import Rotation

    position, angles = SI[tracked.unit][1] * values[:, :3], values[:, 3:]
    seen = np.asarray(np.isfinite(values).all(axis=1) & position.any(axis=1))
    seen &= (np.abs(position) < _MAX_POSITION_M).all(axis=1)
    rotation = None
    if angles.shape[1] == 4:
        angles = np.roll(angles, -1, axis=1) if tracked.orientation == "wxyz" else angles
        seen &= np.abs(np.linalg.norm(angles, axis=1) - 1.0) < 0.1
        rotation = Rotation.from_quat(np.where(seen[:, None], angles, [0.0, 0.0, 0.0, 1.0])).as_matrix()
    elif angles.shape[1] == 3:
        angles = np.where(seen[:, None], SI[tracked.angle_unit][1] * angles, 0.0)
        vector = tracked.orientation == "vector"
        turned = Rotation.from_rotvec(angles) if vector else Rotation.from_euler(tracked.orientation, angles)
        rotation = turned.as_matrix()
    if rotation is not None:
        rotation[~seen] = np.nan
    return np.where(seen[:, None], position, np.nan), rotation


def path_of(position: Floats, rotation: Floats | None) -> Floats:
    """Return the way [m] and turns [rad] of a frame up to each pose, less its mean speed; NaN if unseen.

    They are the same as seen from any frame.

    Args:
        position, rotation: (M, 3) [m] and (M, 3, 3) or None, in any frame.

    Returns:
        (M, 1 or 2).
    """
    from scipy.spatial.transform import Rotation

    seen = np.flatnonzero(np.isfinite(position).all(axis=1))
    steps = [np.linalg.norm(np.diff(position[seen], axis=0), axis=1)]
    if rotation is not None:
        turns = np.swapaxes(rotation[seen[:-1]], 1, 2) @ rotation[seen[1:]]
        steps.append(Rotation.from_matrix(turns).magnitude())
    path = np.full((len(position), len(steps)), np.nan)
    if len(seen):
        way = np.vstack([np.zeros(len(steps)), np.cumsum(steps, axis=1).T])
        path[seen] = way - np.linspace(0.0, 1.0, len(seen))[:, None] * way[-1]
    return path


def deviations(model: RobotModel, q: Floats, frame: str | None, match: str, noise: Floats = TRACKER_NOISE) -> Floats:
    """Return standard deviations (M, n) [rad|m] of joints that follow from a pose with `noise` (2,) [m], [rad].

    The noise goes through the Jacobian's pseudo-inverse. Infinite of a joint that a pose leaves open: it takes part in
    directions that move the frame _OPEN_SHARE times as far as others, on one scale.
    """
    J = Configuration(model, q).jacobian(frame)
    turning = np.array([unit == "rad" for unit in model.joint_units])
    lever = np.linalg.norm(J[:, :3, turning], axis=1).max(axis=1, initial=0.0)[:, None]
    scale = np.where(turning, 1.0, np.where(lever > 0.0, lever, 1.0))  # (M, n)
    J = J * scale[:, None] / np.repeat(noise, 3)[:, None]
    _, singular_values, axes = np.linalg.svd(J if match == "pose" else J[:, :3])
    sizes = np.zeros(q.shape)
    sizes[:, : singular_values.shape[1]] = singular_values
    is_free = sizes <= _OPEN_SHARE * sizes.max(axis=1, keepdims=True)
    part = axes / np.where(is_free, np.inf, sizes)[:, :, None]
    is_open = (np.abs(axes) * is_free[:, :, None]).max(axis=1) > _OPEN_SHARE
    return np.asarray(np.where(is_open, np.inf, scale * np.linalg.norm(part, axis=1)))


def _noise(model: RobotModel, frame: str | None, seen: Pose, q: Floats) -> Floats:
    """Return the standard deviation of an axis of poses, (2,) [m], [rad]: usual, or more where neighbours scatter."""
    from scipy.spatial.transform import Rotation

    placed = Configuration(model, q).pose(frame)
    turned = Rotation.from_matrix(seen.rotation @ np.swapaxes(placed.rotation, 1, 2)).as_rotvec()
    bends = [np.abs(np.diff(x, n=2, axis=0)) for x in (seen.position - placed.position, turned)]
    scatter = [1.4826 * float(np.median(bend)) / np.sqrt(6.0) if len(q) >= MIN_POSES else 0.0 for bend in bends]
    return np.maximum(TRACKER_NOISE, scatter)


def _vague(model: RobotModel, tracked: TrackedPose, q: Floats, noise: Floats, chosen: list[int]) -> tuple[Flags, str]:
    """Return the rows of q (M, n) that are too near a singularity, (M,), and the accuracy of the others, as text."""

    def shown(sizes: Floats, joints: Sequence[int], form: str = ".2g") -> str:
        units = [DISPLAY[model.joint_units[j]] for j in joints]
        return ", ".join(
            f"{model.joint_names[j]} {s * sizes[j]:{form}} {u}" for j, (u, s) in zip(joints, units, strict=True)
        )

    own = deviations(model, q, tracked.frame, tracked.match, noise)
    least, limit = np.array([_MAX_DEVIATION[unit] for unit in model.joint_units]).T
    bound = np.clip(_MAX_DEVIATION_MEDIANS * np.median(own, axis=0), least, limit)
    beyond = (own > bound)[:, chosen]
    rows = np.asarray(beyond.any(axis=1))
    of = f"noise of poses, {1e3 * noise[0]:.2g} mm" + f" and {np.rad2deg(noise[1]):.2g} deg" * (tracked.match == "pose")
    kept = shown(own[~rows].max(axis=0, initial=0.0), chosen)
    note = f"{of}, leaves a standard deviation of q_encoder of {kept} at most"
    if not rows.any():
        return rows, note
    worst = q[np.argmax((own / bound)[:, chosen].max(axis=1))]
    reach = np.diag([_SINGULAR_REACH[unit] for unit in model.joint_units])
    away = deviations(model, worst + np.vstack([reach, -reach]), tracked.frame, tracked.match, noise) / bound
    at = shown(worst, [int(np.argmin(away[:, chosen].max(axis=1))) % model.n], ".2f")  # it leads away soonest
    lost = [chosen[k] for k in np.flatnonzero(beyond.any(axis=0))]
    counted = f"{int(rows.sum())} of {len(q)} poses lie too near a singularity, the nearest with {at}, and are not ok"
    return rows, f"{counted}: there it would be more than {shown(bound, lost)}; {note}"


def _determined(model: RobotModel, tracked: TrackedPose, q: Floats, chosen: Sequence[int]) -> Flags:
    """Return the rows of q (M, n) at which all chosen joints are determined, (M,)."""
    short = np.isinf(deviations(model, q, tracked.frame, tracked.match))[:, list(chosen)]
    if short.any(axis=1).mean() <= 0.5:
        return np.asarray(~short.any(axis=1))
    lost = ", ".join(model.joint_names[j] for j, share in zip(chosen, short.mean(axis=0), strict=True) if share > 0.5)
    by_pose = np.isfinite(deviations(model, q, tracked.frame, "pose")[:, list(chosen)]).all(axis=1)
    has_pose = tracked.match != "pose" and tracked.frame != _MARKER and np.mean(by_pose) > 0.5
    choices = 'match = "pose" or ' if has_pose else ""
    raise InputError(
        f'q_encoder: the {tracked.match} of "{tracked.frame or model.tip}" leaves {lost} open, of {len(chosen)} '
        f"joints: they would stay where the robot reported them; expected {choices}a frame that they move "
        "(frame = ...) or only the joints before them, of a robot that ends there"
    )


def registered(
    model: RobotModel, tracked: TrackedPose, values: Floats, poses_at: PosesAt, chosen: Sequence[int]
) -> tuple[Pose, Pose, list[str]]:
    """Return T_base_tracker and T_frame_marker, given or found from the poses as recorded, and what to say of that."""
    base = None if tracked.T_base_tracker is None else tracked.T_base_tracker.pose()
    marker = None if tracked.T_marker_frame is None else tracked.T_marker_frame.pose().inverse()
    if base is not None and marker is not None:
        return base, marker, []
    known = {"frame": tracked.frame, "base": base, "marker": marker, "zeros": tracked.zeros}
    made = register_in_time(model, poses_at, chosen, **known)
    if len(made.left) > 1 and made.left[1] > _MAX_TURN_LEFT_RAD:
        q = poses_at(made.found.late).q.copy()
        q[:, chosen] += made.found.offsets
        whole = np.isfinite(np.hstack([q, values])).all(axis=1)
        frame = Configuration(model, q[whole]).pose(tracked.frame).rotation
        _refuse_other_turns(tracked, values[whole], np.swapaxes(frame, 1, 2) @ made.found.base.rotation)
    names, units = ([of[j] for j in chosen] for of in (model.joint_names, model.joint_units))
    return made.found.base, made.found.marker, made.notes(names, units)


def lateness(
    model: RobotModel, tracked: TrackedPose, poses_at: PosesAt, base: Pose, marker: Pose, chosen: Sequence[int]
) -> float:
    """Return the time from the stamps of poses to the robot's reports of the same [s], of a clock set roughly.

    Least squares by it and the offsets of the chosen joints, by Gauss and Newton, without outliers.
    """
    late, offsets = 0.0, np.zeros(model.n)
    for _ in range(_LATENESS_ROUNDS):
        poses = poses_at(late).evenly(_COMPARED_POSES)
        placed = Configuration(model, poses.q + offsets)
        frame, J = placed.pose(tracked.frame), placed.jacobian(tracked.frame, marker.position)[:, :3]
        seen = poses.position @ base.rotation.T + base.position
        apart = seen - frame.rotation @ marker.position - frame.position
        size = np.linalg.norm(apart, axis=1)
        rows = size <= _MAX_DEVIATION_MEDIANS * np.nanmedian(size)
        A = np.concatenate([J[:, :, list(chosen)], J @ poses.qd[:, :, None]], axis=2)[rows]
        step = np.linalg.lstsq(A.reshape(-1, A.shape[2]), apart[rows].ravel(), rcond=None)[0]
        offsets[list(chosen)] += step[:-1]
        late += float(step[-1])
    return late


def _refuse_other_turns(tracked: TrackedPose, values: Floats, frame_tracker: Floats) -> None:
    """Refuse orientations that do not turn with R_frame_tracker (M, 3, 3), and say as which others they would."""
    from scipy.spatial.transform import Rotation

    orders = ["vector", *map("".join, [*permutations("xyz"), *permutations("XYZ")])]
    ways = product(orders, ("rad", "deg")) if values.shape[1] == 6 else product(("xyzw", "wxyz"), (tracked.angle_unit,))
    left = {}
    for way in ways:
        in_its_way = tracked.model_copy(update={"orientation": way[0], "angle_unit": way[1]})
        turns = positions_and_rotations(in_its_way, values)[1]
        assert turns is not None  # for the type checker
        marker = Rotation.from_matrix((frame_tracker @ turns)[np.isfinite(turns).all(axis=(1, 2))])
        left[way] = float(np.rad2deg(np.median((marker * marker.mean().inv()).magnitude())))
    own, best = (tracked.orientation, tracked.angle_unit), min(left, key=left.__getitem__)
    is_other = 3.0 * left[best] < left[own]
    if is_other or left[own] > _UNRELATED_TURN_DEG:
        other = f'as orientation = "{best[0]}", angle_unit = "{best[1]}" by {left[best]:.1f} deg: say that'
        raise InputError(
            f'registration: the marker\'s orientation, read as "{own[0]}" in {own[1]}, turns otherwise than the robot, '
            f"by {left[own]:.0f} deg in the median, {other if is_other else _UNRELATED_WHY}"
        )


def joints_from_poses(
    model: RobotModel, tracked: TrackedPose, poses: TrackedPoses, base: Pose, marker: Pose, chosen: list[int]
) -> tuple[Floats, list[str]]:
    """Return the joint positions (M, n) [rad|m] at which the robot's frame is nearest to where the marker says; notes.

    T_base_frame = T_base_tracker T_tracker_marker T_marker_frame; of a marker without orientation, the frame's point
    where it sits. NaN if the pose is not finite, no joints within the limits come as near as `within_mm` and
    `within_deg`, or the pose does not determine the chosen joints, or hardly: see _MAX_DEVIATION.
    """
    seen = base @ Pose(np.eye(3) if poses.rotation is None else poses.rotation, poses.position)
    if poses.rotation is None:
        if tracked.match == "pose":
            raise InputError('q_encoder: the marker has a position alone: expected match = "position"')
        link, own = model.frame(tracked.frame)
        model = replace(model, frames={**model.frames, _MARKER: Frame(link, own @ marker)})
        tracked = tracked.model_copy(update={"frame": _MARKER})
        seen = Pose(np.broadcast_to(seen.rotation, (len(poses.q), 3, 3)), seen.position)
    else:
        seen = seen @ marker.inverse()
    q = np.full((len(poses.q), model.n), np.nan)
    usable = np.asarray(np.isfinite(np.hstack([seen.position, poses.q])).all(axis=1))
    if usable.any():
        usable[usable] = _determined(model, tracked, poses.q[usable], chosen)
    for row in np.flatnonzero(usable).tolist():
        pose = Pose(seen.rotation[row], seen.position[row])
        nearest = nearest_coordinates(model, pose, poses.q[row], frame=tracked.frame, match=tracked.match)
        near = 1e3 * nearest.position_error <= tracked.within_mm
        if near and np.rad2deg(nearest.orientation_error) <= tracked.within_deg:
            q[row] = nearest.q
    reached = np.flatnonzero(np.isfinite(q).all(axis=1))
    notes = []
    if len(reached):
        noise = _noise(model, tracked.frame, Pose(seen.rotation[reached], seen.position[reached]), poses.q[reached])
        rows, vague = _vague(model, tracked, q[reached], noise, chosen)
        q[reached[rows]], notes = np.nan, [vague]
    beyond = f"{tracked.within_mm:g} mm" + f" and {tracked.within_deg:g} deg" * (tracked.match == "pose")
    if (lost := int(np.isfinite(poses.q).all(axis=1).sum()) - len(reached)) > 0:
        notes.append(
            f"{lost} of {len(q)} poses were left out: not finite, singular, or beyond {beyond} from all that the "
            "robot reaches"
        )
    return q, notes


def tip_columns(streams: Sequence[Stream], base: str) -> tuple[str, tuple[str, ...]] | None:
    """Return the topic beside a robot's joints in which it says where its tip is, and the columns of that pose."""
    place = base.rpartition("/")[0]
    for stream in (stream for verb in _TIP_VERBS for stream in streams if stream.name == f"{place}/{verb}"):
        taken = next((pose.taken for pose in poses_by_parts(stream) if len(pose.taken) == 7), None)
        if taken is not None:
            return stream.name, taken
    return None


def tip_said(model: RobotModel, q: Floats, joints: Stream, own: Stream, columns: Sequence[str]) -> list[str]:
    """Return a note if the tip of `model` at joints q (M, n) lies far from the robot's own report."""
    from scipy.spatial.transform import Rotation

    values = np.column_stack([own.columns[column] for column in columns])
    headed = all(stream.stamp is not None and stream.stamp.all() for stream in (joints, own))
    at, there = (stream.stamp if headed else stream.arrival for stream in (joints, own))
    whole = np.isfinite(q).all(axis=1)
    if at is None or there is None or not whole.any():
        return []
    at, q = at[whole], q[whole]
    inside = (there >= at[0]) & (there <= at[-1]) & (np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1.0) < 0.1)
    rows = np.flatnonzero(inside & np.isfinite(values).all(axis=1))
    rows = rows[:: max(1, len(rows) // _COMPARED_POSES)]
    if len(rows) == 0:
        return []
    stated = Pose(Rotation.from_quat(values[rows, 3:]).as_matrix(), values[rows, :3])
    held = np.column_stack([np.interp(there[rows] - at[0], at - at[0], column) for column in q.T])
    by_file = Configuration(model, held).pose()
    ways = {
        "the same as seen from the tip at every pose: another tool": by_file.inverse() @ stated,
        "the same as seen from the base at every pose: another base frame": stated @ by_file.inverse(),
    }
    apart = np.column_stack([
        1e3 * np.linalg.norm(stated.position - by_file.position, axis=1),
        np.rad2deg(Rotation.from_matrix((by_file.inverse() @ stated).rotation).magnitude()),
    ])  # fmt: skip
    far = np.median(apart, axis=0)
    if (far < _SAME_TIP_MM_DEG).all():
        return []
    limit = np.maximum(_SAME_TIP_MM_DEG, _STEADY_SHARE * far)

    def spread(why: str) -> float:
        turns = Rotation.from_matrix(ways[why].rotation)
        turned = np.rad2deg((turns * turns.mean().inv()).magnitude())
        moved = 1e3 * np.linalg.norm(ways[why].position - np.median(ways[why].position, axis=0), axis=1)
        return float(np.max(np.median([moved, turned], axis=1) / limit))

    why = min(ways, key=spread)
    why = why if spread(why) < 1.0 else "other at every pose: another robot, or other units"
    return [
        f"{own.name} lies {far[0]:.1f} mm and {far[1]:.1f} deg from the tip of {model.name} at the joints that it "
        f"reports (median of {len(rows)} poses), {why}"
    ]
