"""Cable transmission from motors to joints: coupling, elasticity with hysteresis and creep, friction, drift."""
