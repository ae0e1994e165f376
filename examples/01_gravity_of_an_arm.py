"""What it takes to hold a RAVEN-II still, level and tilted.

Prints what the three positioning joints hold, in Nm and N: first over the insertion of the tool, then over the tilt of
the base. Tilted to its side, the arm hangs on the elbow, and nothing is left for the shoulder. The last line compares
the torques with the slope of the potential energy.
"""

import numpy as np

import catenary

arm = catenary.load_robot("raven2")
level = np.array([0.0, 0.0, -9.81])

print("insertion [mm]   shoulder [Nm]   elbow [Nm]   insertion [N]")
for insertion in (0.25, 0.35, 0.45, 0.55):
    q = np.array([np.deg2rad(30), np.deg2rad(90), insertion])
    shoulder, elbow, force = catenary.gravity_torque(arm, q, level)
    print(f"{1000 * insertion:14.0f} {shoulder:15.4f} {elbow:12.4f} {force:15.4f}")

print("\ntilt [deg]       shoulder [Nm]   elbow [Nm]   insertion [N]")
q = np.array([np.deg2rad(30), np.deg2rad(90), 0.40])
for tilt in np.deg2rad([0, 30, 60, 90]):
    # the base turned about its x axis: gravity seen from it turns the other way
    gravity = 9.81 * np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    shoulder, elbow, force = catenary.gravity_torque(arm, q, gravity)
    print(f"{np.rad2deg(tilt):10.0f} {shoulder:19.4f} {elbow:12.4f} {force:15.4f}")

h = 1e-6
energy = [catenary.potential_energy(arm, q + h * np.vstack([e, -e]), level) for e in np.eye(3)]
slope = [(ahead - behind) / (2 * h) for ahead, behind in energy]
difference = np.abs(slope - catenary.gravity_torque(arm, q, level)).max()
print(f"\nlargest difference from the slope of the potential energy: {difference:.1e}")
