"""An operator and a robot: homed, moved, watched, recorded."""
