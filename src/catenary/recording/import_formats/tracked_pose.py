"""Joint positions from a tracked marker: its pose in the base, and inverse kinematics from where the robot was."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.dynamics.inverse_kinematics import nearest_coordinates
from catenary.dynamics.kinematics import jacobian
from catenary.errors import InputError
from catenary.recording.import_formats.columns import Place, Stream, places_of
from catenary.recording.import_formats.mapping import SI, TrackedPose
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, rotation_from_quaternion

OPEN = 1e-4  # of what other motions move a frame by: less than a measured pose tells
# geometry_msgs/Pose and Transform
_PARTS = (("position", "orientation"), ("translation", "rotation"))


def pose_places(tracked: TrackedPose, streams: Sequence[Stream]) -> list[Place]:
    """Return where the seven numbers of a pose are: x, y, z, and the quaternion's x, y, z, w."""
    if len(tracked.columns) == 7:
        return [place for column in tracked.columns for place in places_of(column, streams)]
    if len(tracked.columns) != 1:
        raise InputError(f"pose: {len(tracked.columns)} columns, expected a message's pose, or seven columns")
    reference = tracked.columns[0]
    for position, orientation in _PARTS:
        names = [f"{reference}.{position}.{axis}" for axis in "xyz"]
        names += [f"{reference}.{orientation}.{axis}" for axis in "xyzw"]
        try:
            return [place for name in names for place in places_of(name, streams)]
        except InputError:
            continue
    poses = [
        f"{stream.name}.{name.removesuffix('.orientation.w').removesuffix('.rotation.w')}"
        for stream in streams
        for name in stream.columns
        if name.endswith((".orientation.w", ".rotation.w"))
    ]
    raise InputError(f'no pose "{cut(reference)}"; there are {", ".join(map(cut, poses[:10])) or "none"}')


def open_joints(
    model: RobotModel, q: Floats, frame: str | None, match: str, chosen: Sequence[int]
) -> NDArray[np.bool_]:
    """Return which of the chosen joints the pose of a frame, or its position, does not determine, (len(chosen),).

    They take part in a motion of the joints that moves the frame by less than OPEN of what the others do. Metres and
    radians are put on one scale by the frame's longest lever.
    """
    J = jacobian(model, q, frame)
    sliding = np.array([unit == "m" for unit in model.joint_units])
    lever = float(np.linalg.norm(J[:3, ~sliding], axis=0).max(initial=0.0)) or 1.0
    J = np.where(sliding, lever, 1.0) * J / np.array([[lever]] * 3 + [[1.0]] * 3)
    _, sizes, axes = np.linalg.svd(J if match == "pose" else J[:3])
    free = axes[int((sizes > OPEN * sizes.max()).sum()) :]
    return np.asarray(np.abs(free[:, list(chosen)]).max(axis=0, initial=0.0) > OPEN)


def _determined(model: RobotModel, tracked: TrackedPose, q: Floats, chosen: Sequence[int]) -> NDArray[np.bool_]:
    """Return the rows of q (M, n) at which all chosen joints are determined, (M,)."""
    short = np.array([open_joints(model, row, tracked.frame, tracked.match, chosen) for row in q])
    if short.any(axis=1).mean() <= 0.5:
        return np.asarray(~short.any(axis=1))
    lost = ", ".join(model.joint_names[j] for j, share in zip(chosen, short.mean(axis=0), strict=True) if share > 0.5)
    by_pose = [not open_joints(model, row, tracked.frame, "pose", chosen).any() for row in q[:50]]
    choices = 'match = "pose" or ' if tracked.match != "pose" and np.mean(by_pose) > 0.5 else ""
    raise InputError(
        f'q_encoder: the {tracked.match} of "{tracked.frame or model.tip}" leaves {lost} open, of {len(chosen)} '
        f"joints: they would stay where the robot reported them; expected {choices}a frame that they move "
        "(frame = ...) or only the joints before them, of a robot that ends there"
    )


def joints_from_poses(
    model: RobotModel, tracked: TrackedPose, poses: Floats, q_start: Floats, chosen: Sequence[int]
) -> Floats:
    """Return the joint positions at which the robot's frame is nearest to where the marker says.

    T_base_frame = T_base_tracker T_tracker_marker T_marker_frame.

    Args:
        model: The robot.
        tracked: Transforms, frame, and whether the orientation counts.
        poses: (M, 7) of the marker in the tracker's frame: position [tracked.unit], quaternion x, y, z, w.
        q_start: (M, n) near them: what the robot reported; NaN where it reported nothing.
        chosen: Joints that are asked for.

    Returns:
        (M, n) [rad|m]; NaN where the pose is not finite, no joints within the limits come as near as `within_mm` and
        `within_deg`, or the arm is singular, so that the pose does not tell where the chosen joints are.
    """
    base, frame = tracked.T_base_tracker.pose(), tracked.T_marker_frame.pose()
    scale = SI[tracked.unit][1]
    found = np.full((len(poses), model.n), np.nan)
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    usable = np.isfinite(poses).all(axis=1) & np.isfinite(q_start).all(axis=1) & (np.abs(norms - 1.0) < 0.1)
    if usable.any():
        usable[usable] = _determined(model, tracked, q_start[usable], chosen)
    for row in np.flatnonzero(usable).tolist():
        x, y, z, w = poses[row, 3:] / norms[row]
        marker = Pose(rotation_from_quaternion((w, x, y, z)), scale * poses[row, :3])
        nearest = nearest_coordinates(
            model, base @ marker @ frame, q_start[row], frame=tracked.frame, match=tracked.match
        )
        near = 1e3 * nearest.position_error <= tracked.within_mm
        if near and np.rad2deg(nearest.orientation_error) <= tracked.within_deg:
            found[row] = nearest.q
    return found
