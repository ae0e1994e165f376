"""An arm like an xArm7 whose file may round its angles and masses: URDF text, the truth, and recordings of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.plant import MotionLog
from catenary.robots.actuation import MotorInertia, default_actuation
from catenary.robots.model import RobotModel
from catenary.robots.urdf import load_urdf
from moving_arm import LEVEL, recorded

JOINTS = (  # origin, its rpy with A for 90 deg, the link's mass and centre of mass
    ("0 0 0.267", "0 0 0", 2.45, "0 0.003 -0.06"),
    ("0 0 0", "-A 0 0", 1.9, "0 -0.13 0.02"),
    ("0 -0.293 0", "A 0 0", 1.7, "0.05 -0.02 -0.03"),
    ("0.0525 0 0", "A 0 0", 1.77, "0.07 -0.11 0.01"),
    ("0.0775 -0.3425 0", "A 0 0", 1.36, "0 0 -0.2"),
    ("0 0 0", "A 0 0", 1.2, "0.06 0.02 0"),
    ("0.076 0.097 0", "-A 0 0", 0.5, "0 -0.007 -0.03"),
)
FRICTION = np.array([3.0, 3.0, 2.0, 2.0, 1.0, 0.8, 0.8])  # Coulomb [Nm], viscous [Nms/rad]
ROTORS = np.array([1.2, 1.2, 0.8, 0.8, 0.3, 0.2, 0.2])  # [kg m2]
EXACT = repr(np.pi / 2)


def seven_joint_arm(folder: Path, angle: str = EXACT, factors: Floats | None = None, inside: str = "") -> RobotModel:
    """Return the arm of a file with such an angle, masses times factors (7,), and text inside of every joint."""
    parts = ['<robot name="arm7"><link name="l0"/>']
    for i, (xyz, rpy, mass, com) in enumerate(JOINTS, 1):
        mass *= 1.0 if factors is None else factors[i - 1]
        parts.append(
            f'<link name="l{i}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia ixx="{0.01 * mass}" '
            f'ixy="0" ixz="0" iyy="{0.009 * mass}" iyz="0" izz="{0.004 * mass}"/></inertial></link><joint name="j{i}" '
            f'type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/><origin xyz="{xyz}" '
            f'rpy="{rpy.replace("A", angle)}"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" '
            f'velocity="3"/>{inside}</joint>'
        )
    path = folder / "arm7.urdf"
    path.write_text("".join([*parts, "</robot>"]))
    return load_urdf(path)


def seven_joint_log(true: RobotModel) -> MotionLog:
    """Return a recording of it, or of some of its joints, with rotors, friction, and noise of 0.3 Nm."""
    rotors = tuple(MotorInertia(*row) for row in zip(true.joint_names, np.eye(true.n), strict=True))
    own = [int(name[1:]) - 1 for name in true.joint_names]
    beside = np.append(np.column_stack([FRICTION[own], FRICTION[own], np.full(true.n, 0.1)]), ROTORS[own])
    actuation = replace(default_actuation(true.joint_names), motor_inertia=rotors)
    return recorded(replace(true, actuation=actuation), 0, beside=beside, noise=0.3)


def plain_gravity(log: MotionLog, arm: RobotModel, q: Floats) -> Floats:
    """Return gravity's torques (N, n) [Nm] by least squares over links, rotors, friction and constants."""
    part = prepare(log, arm, IdentifyOptions())
    links = torque_regressor(arm, part.q, part.qd, part.qdd, LEVEL)
    drives = [each[:, :, None] * np.eye(arm.n) for each in (np.sign(part.qd), part.qd, 1.0 + 0 * part.qd, part.qdd)]
    Y = np.concatenate([links, *drives], axis=2).reshape(-1, links.shape[2] + 4 * arm.n)
    scale = np.where(np.linalg.norm(Y, axis=0) > 0.0, np.linalg.norm(Y, axis=0), 1.0)
    phi = np.linalg.lstsq(Y / scale, part.tau.ravel(), rcond=1e-5)[0] / scale
    return torque_regressor(arm, q, 0 * q, 0 * q, LEVEL) @ phi[: links.shape[2]]
