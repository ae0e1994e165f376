"""Calibration of the joint positions of cable-driven arms: models, fits, evaluation."""
