"""Motions that show a robot's parameters, designed to hit nothing, or run and recorded."""
