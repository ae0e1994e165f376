"""Drivers of serial sensor boards: accelerometers, joint encoders."""
