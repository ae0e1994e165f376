"""The robot's own word of where its tip is, held against its file: a wrong robot, tool or base frame shows at once."""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import Configuration
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.pose_columns import poses_by_parts
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

VERBS = ("local/measured_cp", "measured_cp")  # of CRTK; the first is in the arm's own base
MOST = 300  # poses that are compared, evenly
NEAR = np.array([1.0, 0.5])  # [mm], [deg] within which both are the same
STEADY = 0.05  # of a distance, by which what a tool or a base frame is off by may differ from pose to pose


def tip_columns(streams: Sequence[Stream], base: str) -> tuple[str, tuple[str, ...]] | None:
    """Return the topic beside a robot's joints in which it says where its tip is, and the columns of that pose."""
    place = base.rpartition("/")[0]
    for stream in (stream for verb in VERBS for stream in streams if stream.name == f"{place}/{verb}"):
        taken = next((pose.taken for pose in poses_by_parts(stream) if len(pose.taken) == 7), None)
        if taken is not None:
            return stream.name, taken
    return None


def tip_said(model: RobotModel, q: Floats, joints: Stream, own: Stream, columns: Sequence[str]) -> list[str]:
    """Say how far the tip of `model` at joints q (M, n) lies from where the robot says that it is, if that is far."""
    from scipy.spatial.transform import Rotation

    values = np.column_stack([own.columns[column] for column in columns])
    headed = all(each.stamp is not None and each.stamp.all() for each in (joints, own))
    at, there = (each.stamp if headed else each.arrival for each in (joints, own))
    whole = np.isfinite(q).all(axis=1)
    if at is None or there is None or not whole.any():
        return []
    at, q = at[whole], q[whole]
    inside = (there >= at[0]) & (there <= at[-1]) & (np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1.0) < 0.1)
    rows = np.flatnonzero(inside & np.isfinite(values).all(axis=1))
    rows = rows[:: max(1, len(rows) // MOST)]
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
    if (far < NEAR).all():
        return []
    most = np.maximum(NEAR, STEADY * far)

    def spread(why: str) -> float:
        turns = Rotation.from_matrix(ways[why].rotation)
        turned = np.rad2deg((turns * turns.mean().inv()).magnitude())
        moved = 1e3 * np.linalg.norm(ways[why].position - np.median(ways[why].position, axis=0), axis=1)
        return float(np.max(np.median([moved, turned], axis=1) / most))

    why = min(ways, key=spread)
    why = why if spread(why) < 1.0 else "other at every pose: another robot, or other units"
    return [
        f"{own.name} lies {far[0]:.1f} mm and {far[1]:.1f} deg from the tip of {model.name} at the joints that it "
        f"reports (median of {len(rows)} poses), {why}"
    ]
