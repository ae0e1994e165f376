"""Where the package's prior comes from: simulated arms drawn at random, and what their errors have in common."""
