"""Keyboard teleoperation of a robot from a terminal."""
