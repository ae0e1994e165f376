"""The gravity paper's numbers, by their place: Lewis and Hannaford 2014."""

GAIN_PERCENT = 12.0  # V-B, V-C: joint 1's RMS error with DG below PD's, at 20 deg and on the rocking base
