"""The part of the RAVEN-II's joint space in which it is calibrated."""

import numpy as np

from catenary.arrays import frozen

# limits of joints 1 to 3 in the published trajectories: uw-biorobotics/raven2_CRTK_Python_controller @ c83e669
CALIBRATION_LOWER = frozen(np.array([np.deg2rad(20.0), np.deg2rad(55.0), 0.33]))  # [rad, rad, m]
CALIBRATION_UPPER = frozen(np.array([np.deg2rad(60.0), np.deg2rad(110.0), 0.42]))
