"""Kinematics and rigid-body dynamics of a RobotModel."""
