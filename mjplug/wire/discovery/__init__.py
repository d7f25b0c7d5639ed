"""Which servers are on a network, and what they offer: asked, answered and read in one place.

A server declares a liveliness token with its name, and answers on `<namespace>/<node_name>/interfaces` with a list of
its topics and services. The bridge for ROS 2 has a reader of its own, since it is installed without mjplug.
"""
