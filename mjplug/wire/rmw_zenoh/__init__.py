"""The rmw_zenoh dialect, for ROS 2 nodes with `RMW_IMPLEMENTATION=rmw_zenoh_cpp`.

The format is that of rmw_zenoh since 0.1.2 (Humble), 0.2.4 (Jazzy) and 0.6.0 (Kilted and later). Everything that a
release of rmw_zenoh may change is in this package, one module for each part: keys, quality of service, liveliness
tokens, attachments.
"""
