"""The picture of a robot, or of one of its recordings, in a terminal."""
