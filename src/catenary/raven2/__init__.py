"""RAVEN-II: topics, units, channels, joints and drive train. Each cable robot has such a room."""
