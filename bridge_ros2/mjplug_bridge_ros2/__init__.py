"""Maps the topics and services of an mjplug server, which are on Zenoh, to those of ROS 2.

Needs rclpy, eclipse-zenoh and the standard library, and Python 3.10 or later: it runs in ROS's own Python.
"""
