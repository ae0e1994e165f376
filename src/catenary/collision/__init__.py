"""Collision checking: distances between a robot's links, the floor and obstacles, along whole motions."""
