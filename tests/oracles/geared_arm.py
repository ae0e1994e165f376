"""A UR10 with rotors behind its gears: the description that ROS has of it, and recordings with torques by Pinocchio.

Masses and lengths are those of the old `ur_description` (cylinders); rotors and friction are of the size of real ones.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from catenary.arrays import Floats
from catenary.plant import MotionLog

ROTORS = np.array([2.5, 2.5, 1.2, 0.3, 0.3, 0.3])  # [kg m2]
COULOMB = np.array([12.0, 14.0, 8.0, 3.0, 3.0, 2.5])  # [Nm]
VISCOUS = np.array([10.0, 12.0, 7.0, 2.0, 2.0, 1.5])  # [Nms/rad]
NOISE = np.array([2.0, 2.0, 1.5, 0.6, 0.6, 0.4])  # [Nm] of each sample
MIDDLE, REACH = np.array([0.0, -1.2, 0.6, 0.0, 0.0, 0.0]), np.array([1.6, 0.9, 1.3, 1.6, 1.6, 1.8])
LINKS = (  # name, mass, height of the centre of mass, radius and length of the cylinder
    ("shoulder_link", 7.778, 0.0, 0.075, 0.178),
    ("upper_arm_link", 12.93, 0.306, 0.075, 0.612),
    ("forearm_link", 3.87, 0.28615, 0.075, 0.5723),
    ("wrist_1_link", 1.96, 0.0, 0.075, 0.12),
    ("wrist_2_link", 1.96, 0.0, 0.075, 0.12),
    ("wrist_3_link", 0.202, 0.0, 0.032, 0.04),
)
JOINTS = (  # name, origin, turned about y, axis, effort
    ("shoulder_pan_joint", "0 0 0.1273", 0.0, "0 0 1", 330),
    ("shoulder_lift_joint", "0 0.220941 0", np.pi / 2, "0 1 0", 330),
    ("elbow_joint", "0 -0.1719 0.612", 0.0, "0 1 0", 150),
    ("wrist_1_joint", "0 0 0.5723", np.pi / 2, "0 1 0", 54),
    ("wrist_2_joint", "0 0.1149 0", 0.0, "0 0 1", 54),
    ("wrist_3_joint", "0 0 0.1157", 0.0, "0 1 0", 54),
)
NAMES = tuple(joint[0] for joint in JOINTS)


@cache
def ur10_urdf() -> str:
    """Return the description."""
    parts, parent = ['<robot name="ur10"><link name="base_link"/>'], "base_link"
    for (name, mass, height, radius, length), (joint, origin, turned, axis, effort) in zip(LINKS, JOINTS, strict=True):
        across, along = mass * (3 * radius**2 + length**2) / 12, 0.5 * mass * radius**2
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="0 0 {height}"/><mass value="{mass}"/><inertia ixx="{across}" '
            f'ixy="0" ixz="0" iyy="{across}" iyz="0" izz="{along}"/></inertial></link><joint name="{joint}" '
            f'type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="{origin}" rpy="0 {turned} 0"/>'
            f'<axis xyz="{axis}"/><limit lower="-6.2832" upper="6.2832" effort="{effort}" velocity="3"/></joint>'
        )
        parent = name
    return "".join((*parts, "</robot>"))


def write_ur10(folder: Path) -> Path:
    """Write the description as a file."""
    path = folder / "ur10.urdf"
    path.write_text(ur10_urdf())
    return path


def ur10_log(
    seed: int,
    *,
    rotors: Floats = ROTORS,
    payload: tuple[float, list[float]] | None = None,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    friction: float = 1.0,
    moving: int = 6,
    rate: float = 125.0,
) -> MotionLog:
    """Return 30 s of a Fourier motion.

    Args:
        payload: Mass [kg] and place [m] of a point on the last link.
        friction: Times that of other days.
        moving: How many joints move, from the base on; the others are held.
    """
    model = pin.buildModelFromXML(ur10_urdf())
    model.gravity.linear = np.array(gravity)
    if payload is not None:
        point = pin.Inertia(payload[0], np.array(payload[1]), np.zeros((3, 3)))
        model.appendBodyToJoint(6, point, pin.SE3.Identity())
    data, rng = model.createData(), np.random.default_rng(seed)
    t = np.arange(int(30.0 * rate)) / rate
    w = 2 * np.pi * 0.1 * np.arange(1, 6)
    q, qd, qdd = np.zeros((3, len(t), 6))
    for j in range(moving):
        size, angle = rng.normal(size=5) / np.sqrt(np.arange(1, 6)), w * t[:, None] + rng.uniform(0.0, 6.28, 5)
        scale = REACH[j] / np.abs(np.sin(angle) @ size).max()
        q[:, j] = MIDDLE[j] + scale * np.sin(angle) @ size
        qd[:, j] = scale * np.cos(angle) @ (w * size)
        qdd[:, j] = -scale * np.sin(angle) @ (w**2 * size)
    q[:, moving:] = 0.3
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau += qdd * rotors + friction * (COULOMB * np.tanh(qd / 0.005) + VISCOUS * qd)
    tau += NOISE * rng.normal(size=tau.shape)
    q, qd = q + 1e-5 * rng.normal(size=q.shape), qd + 1e-3 * rng.normal(size=q.shape)
    every = np.ones(len(t), dtype=bool)
    return MotionLog(f"run{seed}", NAMES, ("rad",) * 6, q, every, time=t, qd=qd, tau=tau)


def ur10_gravity(q: Floats) -> Floats:
    """Return the gravity torques (N, n) of the true arm on a level base [Nm]."""
    model = pin.buildModelFromXML(ur10_urdf())
    data = model.createData()
    return np.array([pin.computeGeneralizedGravity(model, data, row) for row in q])
