"""Bags: recorded topics in MCAP files with the layout of rosbag2. Needs no server and no ROS."""
