"""The live picture in a browser: an arm, where it is reported, calibrated and true, and what it feels."""
