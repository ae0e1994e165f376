"""Cable-driven arms drawn by seed, whose true joint positions are known, and models of an afternoon to beat on them."""
