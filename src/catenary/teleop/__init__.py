"""A robot moved by hand from the keyboard of any terminal."""
