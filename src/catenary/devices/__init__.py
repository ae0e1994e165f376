"""Drivers of boards on a serial line."""
