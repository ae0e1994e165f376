"""A robot watched, or one of its recordings."""
