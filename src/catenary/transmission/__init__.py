"""What lies between a motor and its joint, one effect to a file: coupling, elasticity, hysteresis, friction, drift."""
