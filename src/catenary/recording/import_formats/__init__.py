"""Recordings that other programs made, of any topics and columns, brought into a MotionLog by a mapping."""
