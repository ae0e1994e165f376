"""Robots as constant data: tables, URDF and MJCF read into one RobotModel."""
