"""A model after the day of its fit: whether it still holds, and brought up to date."""
