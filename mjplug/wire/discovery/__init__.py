"""Finds the servers on a network and their topics and services.

A server declares a liveliness token with its name, and replies on `<namespace>/<node_name>/interfaces` with a list of
its topics and services. The bridge for ROS 2 has its own decoder, because it is installed without mjplug.
"""
