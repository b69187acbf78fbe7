"""ROS 2 nodes: the only place that imports rclpy; each node a thin shell over the stage functions."""
