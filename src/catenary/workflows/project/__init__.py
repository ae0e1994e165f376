"""A calibration in one folder, step by step, with a simulated robot or a real one."""
