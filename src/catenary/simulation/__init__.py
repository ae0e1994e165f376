"""Robots in the computer: cable physics, the robot's own firmware, homing, moving bases, sensors."""
