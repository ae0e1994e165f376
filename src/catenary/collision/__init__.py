"""What touches what: distances between a robot's links, the floor and other things, along whole motions."""
