"""Findings about faults in recordings, before anything is fitted to them."""
