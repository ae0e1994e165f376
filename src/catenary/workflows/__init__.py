"""Workflows of the package, one per file: fit, calibrate, identify, check, export."""
