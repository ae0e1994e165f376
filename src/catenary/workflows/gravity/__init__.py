"""Controllers and gravity compensation tried on a simulated arm."""
