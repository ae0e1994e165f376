"""What is known of the RAVEN-II: topics, units, channels, joints, drive train; another cable robot is a room beside."""
