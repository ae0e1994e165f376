"""ROS 2 without ROS 2: its names, types and qualities of service over DDS, by the `cyclonedds` package."""
