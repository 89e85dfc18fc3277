"""Recordings of ROS 1, ROS 2 and MCAP, written in KITTI's raw layout."""
