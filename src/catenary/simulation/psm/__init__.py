"""A simulated da Vinci PSM: seven motors, a wrist on long cables, the dVRK's position control."""
