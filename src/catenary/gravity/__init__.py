"""Gravity torques of joints, payloads and their estimation."""
