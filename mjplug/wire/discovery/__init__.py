"""Discovery of the servers on a network, with their topics and services.

A server declares a liveliness token with its name, and answers on `<namespace>/<node_name>/interfaces` with a list of
its topics and services. The bridge for ROS 2 has its own implementation, because it is installed without mjplug.
"""
