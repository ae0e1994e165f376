"""The gravity vector itself: read from sensors, checked, with a fallback, and mounted on a base."""
