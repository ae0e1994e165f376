"""The gravity vector: sensors on a base, their readings checked, smoothed, and replaced where they fail."""
