"""A robot moved from the keyboard of any terminal."""
