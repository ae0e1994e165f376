"""Units of joints and their torques: SI inside, degrees and millimetres where people read."""

import numpy as np

# what people read: the unit, and how many of it make one SI unit
DISPLAY = {"rad": ("deg", float(np.rad2deg(1.0))), "m": ("mm", 1000.0)}
TORQUE_UNIT = {"rad": "Nm", "m": "N"}
