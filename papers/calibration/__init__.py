"""The joint-calibration paper: Peng et al., Efficient data-driven joint-level calibration."""
