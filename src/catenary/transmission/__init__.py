"""What lies between a motor and its joint, coupling, elasticity (with hysteresis and creep), friction, drift."""
