"""Design poses or a motion that show a robot's parameters, keep its limits and hit nothing; and write them."""

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.collision.scene import POSES, Names, scene_of
from catenary.errors import InputError
from catenary.files import write_atomically
from catenary.identification.excitation import Excitation, MotionLimits, Room, fourier_motion, static_poses
from catenary.plant import Jointed
from catenary.robots.geometry import Geometry, Shape
from catenary.robots.model import RobotModel


@dataclass(frozen=True)
class MotionSurroundings:
    """Obstacles of a robot's motion."""

    geometry: Geometry | None  # the robot's own shapes; None: collisions are unchecked
    obstacles: tuple[Shape, ...] = ()
    margin: float = 0.01  # [m]
    ignored: tuple[Names, ...] = ()  # pairs that may touch
    unchecked: str = ""  # why there is no geometry


@dataclass(frozen=True)
class DesignedMotion:
    """A design, what it keeps, and notes for the reader."""

    design: Excitation
    limits: MotionLimits
    notes: tuple[str, ...]

    def kept(self) -> list[str]:
        """Return in words what the design keeps."""
        checked, scene = self.design.checked, self.limits.scene
        lines = []
        if checked is not None and checked.torque is not None:
            worst = int(np.argmax(checked.torque))
            name = self.limits.model.joint_names[worst]
            lines.append(
                f"torques: at most {100 * checked.torque[worst]:.0f} % of their limits ({name}), without friction"
            )
        if scene is None:
            lines.append("collisions: UNCHECKED")
        elif checked is None or checked.clearance is None:
            lines.append(f"collisions: none in any pose, {len(scene.pairs)} pairs of shapes")
        else:
            closest = checked.clearance
            lines.append(
                f"collisions: none at any instant; of {len(scene.pairs)} pairs of shapes {closest.pair[0]} and "
                f"{closest.pair[1]} come closest, {1000 * closest.distance:.0f} mm at {closest.time:.2f} s"
            )
        return lines

    def summary(self) -> dict[str, Any]:
        """Return plain data."""
        design, scene, checked = self.design, self.limits.scene, self.design.checked
        collisions: dict[str, Any] = {"checked": scene is not None}
        if scene is not None:
            collisions |= {"shapes": scene.origin, "assumed": scene.assumed, "pairs": len(scene.pairs)}
            collisions["margin_mm"] = 1000.0 * self.limits.margin
        if checked is not None and (closest := checked.clearance) is not None:
            apart = {"distance_mm": 1000.0 * closest.distance, "time_s": closest.time}
            collisions |= {"closest": {"pair": list(closest.pair), **apart}, "instants": closest.instants}
        content: dict[str, Any] = {
            "robot": self.limits.model.name,
            "terms": design.terms,
            "rows": len(design.q),
            "n_base": design.base.count,
            "condition": design.condition,
            "collisions": collisions,
            "torques_checked": self.limits.has_torques,
            "notes": list(self.notes),
        }
        if checked is not None and checked.torque is not None:
            content["torque_share"] = checked.torque.tolist()
        return content


def design_excitation(
    model: RobotModel,
    room: Room,
    around: MotionSurroundings,
    rng: np.random.Generator,
    *,
    gravity: Floats,
    static: int | None = None,
    **shape: Any,
) -> DesignedMotion:
    """Design static poses or a motion that excite a robot's parameters, within limits and clear of obstacles.

    Args:
        gravity: Free-fall acceleration in base axes (3,) [m/s2].
        static: Number of poses to hold; a motion when None.
        **shape: Period, harmonics, rate and trials of a motion (`fourier_motion`).
    """
    limits, notes = _limits(model, room, around, gravity, rng)
    if static is not None:
        notes.append("the ways from pose to pose are not checked for collisions")
        return DesignedMotion(static_poses(limits, static, rng), limits, tuple(notes))
    return DesignedMotion(fourier_motion(limits, rng, **shape), limits, tuple(notes))


def _limits(
    model: RobotModel, room: Room, around: MotionSurroundings, gravity: Floats, rng: np.random.Generator
) -> tuple[MotionLimits, list[str]]:
    """Return the limits of the motion, and notes on those that are assumed or not checked."""
    notes: list[str] = []
    scene = None
    if around.geometry is None:
        notes.append(f"warning: COLLISIONS ARE UNCHECKED: {around.unchecked}")
    else:
        within = replace(model, lower=room.lower, upper=room.upper)
        scene = scene_of(within, around.geometry, around.obstacles, ignored=around.ignored)
        poses = rng.uniform(*room.inner(), (POSES, model.n))
        scene, always = scene.without_constant_contacts(poses, around.margin)
        notes += around.geometry.notes
        if around.geometry.assumed:
            notes.append(f"shapes are assumed, not measured: {around.geometry.origin}")
        if always:
            pairs = ", ".join(f"{a} and {b}" for a, b in always)
            notes.append(f"within {1000 * around.margin:g} mm of each other in every pose, and not compared: {pairs}")
        if not around.obstacles:
            notes.append("no floor, box or mesh is given: only self-collisions are checked")
    limits = MotionLimits(model, room, gravity, scene, around.margin)
    if not limits.has_torques:
        why = "limits" if np.isinf(room.effort).all() else "masses"
        notes.append(f"torques are unchecked: {model.name} has no {why} of them".replace("masses of them", "masses"))
    return limits, notes


def write_motion(path: Path, joints: Jointed, time: Floats, q: Floats, qd: Floats, qdd: Floats) -> None:
    """Write a motion with `t`, `q`, `dq`, `ddq`, `joint_names` and `units` as .npz, or as .csv, by the file's suffix.

    Args:
        time: Times (N,) [s].
        q, qd, qdd: Positions [rad or m], velocities and accelerations, (N, n) each.
    """
    if path.suffix.lower() == ".csv":
        named = list(zip(joints.joint_names, joints.joint_units, strict=True))
        kinds = (("q", ""), ("dq", "/s"), ("ddq", "/s2"))
        header = ["t [s]", *(f"{kind}:{name} [{unit}{per}]" for kind, per in kinds for name, unit in named)]
        rows = np.column_stack([time, q, qd, qdd])
        lines = [",".join(header), *(",".join(repr(float(v)) for v in row) for row in rows)]
        write_atomically(path, ("\n".join(lines) + "\n").encode())
    else:
        buffer = io.BytesIO()
        motion = {"t": time, "q": q, "dq": qd, "ddq": qdd}
        np.savez(buffer, allow_pickle=False, joint_names=joints.joint_names, units=joints.joint_units, **motion)
        write_atomically(path, buffer.getvalue())


def write_trajectory(design: Excitation, joint_names: Sequence[str], path: Path, *, ros: int = 2) -> None:
    """Write a motion as a trajectory_msgs/JointTrajectory: JSON, which is YAML too, a point on each line.

    Args:
        ros: Version of ROS, 1 or 2.
    """
    if design.terms == "static":
        raise InputError("a trajectory needs a motion, not poses to hold")
    seconds, nanoseconds = ("secs", "nsecs") if ros == 1 else ("sec", "nanosec")
    points = []
    for time, *row in zip(design.time, design.q, design.qd, design.qdd, strict=True):
        whole, fraction = divmod(round(float(time) * 1e9), 10**9)
        values = {
            key: [float(v) for v in numbers]
            for key, numbers in zip(("positions", "velocities", "accelerations"), row, strict=True)
        }
        points.append(json.dumps({**values, "time_from_start": {seconds: whole, nanoseconds: fraction}}))
    names = json.dumps(list(joint_names))
    lines = ",\n".join(points)
    write_atomically(path, f'{{"joint_names": {names}, "points": [\n{lines}\n]}}\n'.encode())
