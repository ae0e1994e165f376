"""Motions that show a robot's parameters and hit nothing."""
