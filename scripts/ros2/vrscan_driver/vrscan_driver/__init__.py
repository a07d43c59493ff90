"""A driver for ROS 2: publishes the points of a VR-SCAN board."""
