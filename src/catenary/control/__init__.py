"""Controllers, limits on torque, and the loop that runs them on any robot."""
