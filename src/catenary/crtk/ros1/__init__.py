"""ROS 1 through rospy, which is imported only when a transport is made."""
