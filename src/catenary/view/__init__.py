"""Live 3D view in a browser: reported, calibrated and true arm, gravity, curves, controls of a simulated arm."""
