"""ROS 2 through rclpy, which is imported only when a transport is made."""
