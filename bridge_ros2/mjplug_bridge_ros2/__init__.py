"""Maps the Zenoh topics and services of an mjplug server to ROS 2 topics and services.

Requires rclpy, eclipse-zenoh and Python 3.10 or later: it runs in the Python of ROS.
"""
