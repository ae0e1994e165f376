"""Collaborative Robotics Toolkit: robots and their clients over ROS 1, ROS 2, or within one process."""
