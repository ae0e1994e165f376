"""The methods that the joint-calibration paper compares with, built anew to learn from the same recordings as ours."""
