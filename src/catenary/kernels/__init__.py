"""Machine code of a computation: traced once, a straight line of operations, compiled and called."""
