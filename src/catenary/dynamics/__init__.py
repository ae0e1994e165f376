"""Kinematics, mass matrix and inverse dynamics of a RobotModel."""
