"""Joint positions from a tracked marker: its pose in the base, and inverse kinematics from where the robot was."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.documents import cut
from catenary.dynamics.inverse_kinematics import nearest_coordinates
from catenary.errors import InputError
from catenary.recording.foreign.mapping import SI, TrackedPose
from catenary.recording.foreign.stream import Place, Stream, places_of
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, rotation_from_quaternion

# geometry_msgs/Pose and Transform
_PARTS = (("position", "orientation"), ("translation", "rotation"))


def pose_places(tracked: TrackedPose, streams: Sequence[Stream]) -> list[Place]:
    """Return where the seven numbers of a pose are: x, y, z, and the quaternion's x, y, z, w.

    Raises:
        InputError: They are not there.
    """
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


def joints_from_poses(model: RobotModel, tracked: TrackedPose, poses: Floats, q_start: Floats) -> Floats:
    """Return the joint positions at which the robot's frame is nearest to where the marker says.

    T_base_frame = T_base_tracker T_tracker_marker T_marker_frame; joints that do not move the frame stay where they
    were.

    Args:
        model: The robot.
        tracked: Transforms, frame, and whether the orientation counts.
        poses: (M, 7) of the marker in the tracker's frame: position [tracked.unit], quaternion x, y, z, w.
        q_start: (M, n) near them: what the robot reported; NaN where it reported nothing.

    Returns:
        (M, n) [rad|m]; NaN where the pose is not finite, or no joints within the limits come as near as
        `within_mm` and `within_deg`.
    """
    base, frame = tracked.T_base_tracker.pose(), tracked.T_marker_frame.pose()
    scale = SI[tracked.unit][1]
    found = np.full((len(poses), model.n), np.nan)
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    usable = np.isfinite(poses).all(axis=1) & np.isfinite(q_start).all(axis=1) & (np.abs(norms - 1.0) < 0.1)
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
