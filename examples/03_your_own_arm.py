"""Describe an arm of your own by a DH table, and ask it where it is and what it weighs.

Writes a table of two turning joints to a temporary folder and loads it. Prints where its tip is, the joints that bring
the tip there again, what gravity asks of each joint, and how far those joints are from the ones it began with.
"""

import tempfile
from pathlib import Path

import numpy as np

import catenary

TABLE = """
name = "my_arm"
convention = "modified"
sources = ["data sheet, page 3"]
tip = "tip"

[[link]]
name = "upper"
joint = "revolute"
alpha_deg = 90                                # its axis lies level: it swings up and down
a_m = 0.0
d_m = 0.0
theta_deg = 0
limits_deg = [-90, 90]
mass_kg = 2.0
com_m = [0.15, 0, 0]
inertia_kg_m2 = [0.001, 0, 0, 0.02, 0, 0.02]  # xx xy xz yy yz zz about the centre of mass

[[link]]
name = "fore"
joint = "revolute"
alpha_deg = 0
a_m = 0.4
d_m = 0.0
theta_deg = 0
limits_deg = [0, 150]
mass_kg = 1.0
com_m = [0.1, 0, 0]
inertia_kg_m2 = [0.001, 0, 0, 0.01, 0, 0.01]

[[frame]]
name = "tip"
link = "fore"
position_m = [0.3, 0, 0]
"""
path = Path(tempfile.mkdtemp()) / "my_arm.toml"
path.write_text(TABLE)
arm = catenary.load_robot(path)
q = np.array([-0.4, 1.1])
pose = catenary.forward_kinematics(arm, q)
print(f"tip at {1000 * pose.position} mm")
found = catenary.inverse_kinematics(arm, pose, [0.0, 0.5])
print(f"joints that bring it there: {found} rad")
print(f"gravity asks for {catenary.gravity_torque(arm, found, [0, 0, -9.81])} Nm")
print(f"difference from the joints it began with: {np.abs(found - q).max():.1e} rad")
